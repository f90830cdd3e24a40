"""Models of what becomes of images: features, their distribution, prior poses."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from p2gd_fgo.config.base import Model, NonNegative, Positive


class FrontendConfig(Model):
    """Feature extraction and tracking."""

    max_features: int | None = Field(
        None, ge=8, le=5000, description="features kept per image; null: by image width"
    )
    grid: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] | None = Field(
        None, description="[columns, rows] of cells; null: by image width"
    )
    min_distance_px: Positive | None = Field(
        None, description="between features, in px; null: by image width"
    )
    max_track_length: int | None = Field(
        None, ge=2, description="frames; a track that long is consumed; null: backend.window"
    )
    fast_threshold: int = Field(20, ge=2, le=250, description="grey levels, FAST corner test")
    klt_window_px: int = Field(15, ge=5, le=51, description="side of the KLT patch")
    klt_levels: int = Field(5, ge=1, le=8, description="pyramid levels")
    forward_backward_px: Positive = Field(
        1.0, description="largest distance between a point and its way there and back"
    )
    ransac_px: Positive = Field(
        2.0, description="px; largest distance of a track from its epipolar line"
    )
    equalize: bool = Field(False, description="equalise the histogram of every image")
    subpixel: bool = Field(True, description="refine new corners below the pixel")
    predict_flow: bool = Field(True, description="start KLT where the gyro's rotation points")
    tracker: Literal["klt", "orb"] = Field(
        "klt", description="klt: optical flow; orb: matching of descriptors"
    )
    anchor: bool = Field(
        False,
        description="move every track to where the patch in which it began fits: no drift from "
        "image to image",
    )
    orb_search_px: Positive = Field(
        60.0, description="tracker orb: search radius around where the gyro's rotation points"
    )
    orb_max_hamming: int = Field(
        80, ge=0, le=256, description="tracker orb: bits of 256 in which a match may differ"
    )
    orb_ratio: Annotated[float, Field(gt=0, le=1)] = Field(
        0.95, description="tracker orb: largest share of the second best candidate's bits"
    )
    continue_consumed: bool = Field(
        False, description="follow the corner of a track at its maximum length as a new track"
    )


class SceneConfig(Model):
    """Which triangulated features stand for the 3-D scene (paper III-B1)."""

    min_views: int = Field(3, ge=2, description="images that a feature must have been seen in")
    max_condition: Positive = Field(
        1e4, description="of the linear system; larger: too little parallax"
    )
    max_depth: Positive = Field(60.0, description="m, farther points are not believed")
    max_reprojection_px: Positive = Field(3.0, description="RMS over the views")
    keep_after_views: int = Field(
        10, ge=2, description="a position from more views than this is kept as it is"
    )


class P2gdConfig(Model):
    """Prior-pose-guided distribution; docs/p2gd.md says where defaults aren't the paper's."""

    weight: Literal["total_parallax", "track_length"] = Field(
        "total_parallax", description="of a predicted track (total_parallax: paper eq. 6)"
    )
    into_loss: bool = Field(
        False, description="total_parallax: count the step into the image that loses the feature"
    )
    allocate: Literal["proportional", "d_optimal"] = Field(
        "proportional",
        description="proportional: the paper's Algorithm 1; d_optimal: greedy, largest log det "
        "of the predicted pose information",
    )
    when: Literal["after_tracking", "before_tracking"] = Field(
        "after_tracking",
        description="after: on the new image's predicted pose; before: on the last estimate, as "
        "in the paper",
    )
    horizon: int | None = Field(
        None, ge=1, le=200, description="prior poses used, in images; null: backend.window"
    )
    floor: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0, description="least quota of every cell with corners, as a share of the grid's quota"
    )
    share_new_cells: bool = Field(
        False, description="cells that a turn has just brought into view get the grid's quota"
    )
    still_parallax_px: NonNegative = Field(
        0.0,
        description="below this mean predicted motion per image in px (rotation left out) the "
        "quotas are the grid's; 0: never",
    )
    scene: SceneConfig = SceneConfig()


class DistributionConfig(Model):
    """How the feature quota is spread over the image's cells."""

    kind: Literal["grid", "p2gd", "quadtree", "anms", "uniform_random"] = Field(
        "grid",
        description="grid: the same quota in every cell; p2gd: by predicted tracking; quadtree, "
        "anms: evenly over the corners found; uniform_random: any corner",
    )
    refill: bool = Field(
        False, description="grid, p2gd: quota that a cell can't serve goes to the other cells"
    )
    p2gd: P2gdConfig = P2gdConfig()


class PriorsConfig(Model):
    """Where prior poses come from: the robot's planner, or a stand-in for it."""

    source: Literal[
        "auto", "truth", "noisy_truth", "file", "stream", "constant_velocity", "none"
    ] = Field(
        "auto",
        description="auto: truth where the recording has it, else constant_velocity; stream: "
        "handed in with every image; none: no planner",
    )
    file: str | None = Field(
        None,
        description="TUM trajectory of a planner, for source: file (a relative path starts at the "
        "working directory)",
    )
    position_noise: NonNegative = Field(
        0.0, description="m, 1 sigma on x and y of every pose, for source: noisy_truth"
    )
    yaw_noise_deg: NonNegative = Field(
        0.0, description="1 sigma on every pose's yaw, for source: noisy_truth"
    )

    @model_validator(mode="after")
    def _source_of_what_is_given(self) -> PriorsConfig:
        noisy = self.position_noise > 0.0 or self.yaw_noise_deg > 0.0
        for given, name, source in (
            (self.file is not None, "file", "file"),
            (noisy, "position_noise or yaw_noise_deg", "noisy_truth"),
        ):
            if given and self.source != source:
                raise ValueError(
                    f"priors.{name} is set, but priors.source is '{self.source}': set it to "
                    f"'{source}', or leave the other away"
                )
        return self

    check: bool = Field(
        True, description="compare with the motion that followed; contradicted: quotas of the grid"
    )
    max_deviation: Annotated[float, Field(gt=0, lt=1)] = Field(
        0.33,
        description="of planned positions half a horizon ahead, in the mean of ten images, as a "
        "share of the way",
    )
    max_noise: Positive = Field(
        1.0, description="m RMS, of planned positions half a horizon ahead, beyond the way driven"
    )
    max_turn_error_deg: Positive = Field(
        20.0, description="RMS, of planned rotations half a horizon ahead"
    )
