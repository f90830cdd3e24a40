"""From a scenario to everything that is needed to render it: drive, sensors, world, movers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.simulation.courtyard import courtyard
from p2gd_fgo.simulation.driving import Drive, drive
from p2gd_fgo.simulation.effects import exposure_at
from p2gd_fgo.simulation.movers import Mover
from p2gd_fgo.simulation.network import Network, network_of_route, random_network, way_along
from p2gd_fgo.simulation.palette import palette
from p2gd_fgo.simulation.recorded import drive_recorded, file_hash
from p2gd_fgo.simulation.renderer import Exposure, Renderer, Rendering, SensorModel
from p2gd_fgo.simulation.routes import ROBOT, make_route
from p2gd_fgo.simulation.scenario import CameraScenario, Scenario
from p2gd_fgo.simulation.street_paint import ROAD_M
from p2gd_fgo.simulation.town import campus, city
from p2gd_fgo.simulation.traffic import traffic
from p2gd_fgo.simulation.world import World
from p2gd_fgo.types import NANOSECONDS, FloatArray, Image, IntArray

START_NS = 1_700_000_000 * NANOSECONDS
_PATH_M = 3.0
_LANE_M = 1.6
_LEAST_SEEN = 0.04  # share of the image that must not be sky
_IMU_MARGIN_S = 0.1
_ROUTE, _WORLD, _TRAFFIC, _CAMERA = range(4)  # streams of the seed


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What is decided before anything is built.

    Attributes
    ----------
    image_stamps_ns
        (N,) true times of the images, on the IMU's clock.
    """

    scenario: Scenario
    drive: Drive
    network: Network
    calibration: Calibration
    image_stamps_ns: IntArray
    imu_stamps_ns: IntArray

    @property
    def ground_z(self) -> float:
        """Height of the ground in the world; the IMU starts at 0."""
        return self._lowest() - self.scenario.vehicle.imu_height_m

    def _lowest(self) -> float:
        if self.scenario.route.file is None:
            return 0.0
        T = self.drive.trajectory.sample(self.image_stamps_ns).T_world_imu
        return min(float(T[:, 2, 3].min()), 0.0)


def plan(scenario: Scenario) -> Plan:
    """Drive the route and set up the sensors.

    Raises
    ------
    DataError
        A route file that can't be used.
    """
    rng = np.random.default_rng([scenario.seed, _ROUTE])
    width = ROAD_M[1] if scenario.world.kind == "city" else _PATH_M
    if scenario.route.file is not None:
        made = drive_recorded(scenario.route, scenario.duration_s, START_NS)
        network = network_of_route(_shifted(made.way, width), width, rng)
    elif scenario.world.kind == "courtyard":
        made = _yard_drive(scenario, rng)
        network = network_of_route(made.way, width, rng)
    else:
        made, network = _street_drive(scenario, width, rng)
    return Plan(
        scenario,
        made,
        network,
        calibration(scenario),
        _stamps(scenario.duration_s, 0.0, scenario.camera.rate_hz),
        _stamps(scenario.duration_s, _IMU_MARGIN_S, scenario.imu.rate_hz),
    )


def calibration(scenario: Scenario) -> Calibration:
    """Sensors as the estimator is told of them."""
    imu = scenario.imu
    densities = ImuNoise(
        imu.gyro_noise_density,
        imu.gyro_random_walk,
        imu.accel_noise_density,
        imu.accel_random_walk,
    )
    offset = imu.time_offset_s if imu.time_offset_known else 0.0
    camera = scenario.camera
    return Calibration(lens(camera), _mount(camera), densities, offset)


def lens(camera: CameraScenario) -> RadTanCamera:
    """Camera model of a scenario."""
    return RadTanCamera(
        camera.width, camera.height, *camera.focal, *camera.center, *camera.distortion
    )


class Studio:
    """A plan with its world built, ready to take pictures.

    Raises
    ------
    ConfigError
        The camera sees nothing but sky somewhere.
    """

    def __init__(self, plan: Plan) -> None:
        scenario = plan.scenario
        self.plan = plan
        self.world = build_world(plan)
        self.movers: list[Mover] = traffic(
            scenario.traffic,
            plan.drive,
            plan.network,
            palette(scenario.world.detail, scenario.world.contrast),
            np.random.default_rng([scenario.seed, _TRAFFIC]),
            plan.ground_z,
        ) if _busy(scenario) else []  # fmt: skip
        self.renderer = Renderer(plan.calibration.camera, self.world, self.movers)
        self._check_view()

    def view(self, index: int) -> Rendering:
        """Render image ``index``, motion blur included, before the sensor."""
        stamp = self.plan.image_stamps_ns[index]
        state = self.plan.drive.trajectory.sample(np.array([stamp]))
        T_world_imu = state.T_world_imu[0]
        T_imu_cam = self.plan.calibration.T_imu_cam
        R = T_world_imu[:3, :3]
        lever = np.cross(state.angular_rate[0], T_imu_cam[:3, 3])
        exposure = Exposure(
            1e-3 * self.plan.scenario.camera.exposure_ms,
            state.velocity[0] + R @ lever,
            T_imu_cam[:3, :3].T @ state.angular_rate[0],
        )
        time_s = float((stamp - START_NS) / NANOSECONDS)
        return self.renderer.render(T_world_imu @ T_imu_cam, time_s, exposure)

    def expose(self, rendering: Rendering, index: int) -> Image:
        """Grey image (H, W) that the sensor makes of a rendering of image ``index``."""
        scenario, camera = self.plan.scenario, self.plan.scenario.camera
        sensor = SensorModel(camera.noise_sigma, camera.vignetting, camera.shot_noise)
        time_s = float((self.plan.image_stamps_ns[index] - START_NS) / NANOSECONDS)
        swing = exposure_at(time_s, camera.exposure_swing, scenario.seed)
        rng = np.random.default_rng([scenario.seed, _CAMERA, index])
        return sensor.expose(rendering.brightness, rng, camera.exposure_gain * swing)

    def _check_view(self) -> None:
        stamps = self.plan.image_stamps_ns[:: max(len(self.plan.image_stamps_ns) // 4, 1)]
        T = self.plan.drive.trajectory.sample(stamps).T_world_imu @ self.plan.calibration.T_imu_cam
        for stamp, pose in zip(stamps.tolist(), T, strict=True):
            seen = float((self.renderer.inverse_depth(pose) > 0.0).mean())
            if seen < _LEAST_SEEN:
                raise ConfigError(
                    f"camera.tilt_deg {self.plan.scenario.camera.tilt_deg:g}: after "
                    f"{(stamp - START_NS) / NANOSECONDS:.1f} s the camera looks at nothing "
                    f"({100.0 * seen:.0f} % of the image is not sky): tilt it down"
                )


def build_world(plan: Plan) -> World:
    """Build the scene around the drive."""
    scenario = plan.scenario
    seed = scenario.seed if scenario.world.seed is None else scenario.world.seed
    rng = np.random.default_rng([seed, _WORLD])
    stamps = np.linspace(*plan.drive.trajectory.span_ns, 4000).astype(np.int64)
    route = plan.drive.trajectory.sample(stamps).T_world_imu[:, :2, 3]
    if scenario.world.kind == "courtyard":
        return courtyard(route, rng, ground_z=plan.ground_z)
    build = city if scenario.world.kind == "city" else campus
    return build(plan.network, _thinned(route), scenario.world, rng, plan.ground_z)


def with_route_hash(scenario: Scenario) -> Scenario:
    """Name the content of the route's file in the scenario."""
    if scenario.route.file is None or scenario.route.sha256 is not None:
        return scenario
    path = Path(scenario.route.file)
    if not path.is_file():
        return scenario
    route = scenario.route.model_copy(update={"sha256": file_hash(path)})
    return scenario.model_copy(update={"route": route})


def _street_drive(
    scenario: Scenario, width: float, rng: np.random.Generator
) -> tuple[Drive, Network]:
    vehicle, world = scenario.vehicle, scenario.world
    length = 0.8 * vehicle.speed[1] * max(scenario.duration_s - vehicle.standstill_s, 2.0) + 10.0
    wide = world.kind == "city"
    network = random_network(
        length, world.block_m, vehicle.turn_share, width, rng, jitter=0.0 if wide else 0.18
    )
    corners = network.nodes[network.walk].copy()
    corners[0] = 0.0
    pieces = len(corners) - 1
    if wide:
        outer = np.cumsum(rng.random(pieces) < vehicle.lane_changes) % 2
        aside = np.asarray(_LANE_M * (1.0 + 2.0 * outer), np.float64)
    else:
        aside = rng.uniform(-0.4, 0.5, pieces)
    way = way_along(corners, aside, vehicle.turn_radius_m, 1.5 if wide else 0.4)
    start = way[0]  # the drive begins in the origin
    network = replace(network, nodes=network.nodes - start)
    return drive(way - start, vehicle, scenario.duration_s, rng, START_NS), network


def _yard_drive(scenario: Scenario, rng: np.random.Generator) -> Drive:
    trajectory = make_route(
        ROBOT,
        scenario.duration_s,
        rng,
        stops_s=((0.0, scenario.vehicle.standstill_s),),
        start_ns=START_NS,
    )
    first, last = trajectory.span_ns
    stamps = np.arange(first, last, NANOSECONDS // 20, dtype=np.int64)
    way = trajectory.sample(stamps).T_world_imu[:, :2, 3]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    moving = np.concatenate([[True], np.diff(arc) > 1e-4])
    return Drive(trajectory, (stamps - START_NS) / NANOSECONDS, arc, way[moving])


def _mount(camera: CameraScenario) -> FloatArray:
    """T_imu_cam (4, 4): looks along the IMU's x axis, turned left, then tilted down."""
    forward = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    c, s = np.cos(np.radians(camera.tilt_deg)), np.sin(np.radians(camera.tilt_deg))
    pitch = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    c, s = np.cos(np.radians(camera.turn_deg)), np.sin(np.radians(camera.turn_deg))
    yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    T = np.eye(4)
    T[:3, :3] = yaw @ pitch @ forward
    T[:3, 3] = camera.position
    return T


def _stamps(duration_s: float, margin_s: float, rate_hz: int) -> IntArray:
    first, last = -round(margin_s * rate_hz), round((duration_s + margin_s) * rate_hz)
    return START_NS + np.arange(first, last + 1, dtype=np.int64) * NANOSECONDS // rate_hz


def _shifted(way: FloatArray, width: float) -> FloatArray:
    """Move the middle of a wide street to the left of the way driven on it."""
    if width < 6.0 or len(way) < 3:
        return way
    tangent = np.gradient(way, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    return way + _LANE_M * np.column_stack([-tangent[:, 1], tangent[:, 0]])


def _thinned(route: FloatArray) -> FloatArray:
    """Places at least 0.2 m apart."""
    kept = [0]
    for k in range(1, len(route)):
        if np.linalg.norm(route[k] - route[kept[-1]]) > 0.2:
            kept.append(k)
    return route[kept]


def _busy(scenario: Scenario) -> bool:
    t = scenario.traffic
    return bool(t.leading or t.cars_per_min or t.people or t.occluders_per_min)
