"""Typed configuration: frozen models, YAML with ``extends:``, defaults that follow the image."""

from p2gd_fgo.config.features import (
    DistributionConfig,
    FrontendConfig,
    P2gdConfig,
    PriorsConfig,
    SceneConfig,
)
from p2gd_fgo.config.loading import config_hash, dump_yaml, load_config, override, resolve
from p2gd_fgo.config.models import (
    BackendConfig,
    Config,
    DatasetConfig,
    DynamicStartConfig,
    EvaluationConfig,
    GivenStartConfig,
    ImuConfig,
    InitializationConfig,
    MsckfConfig,
    RuntimeConfig,
    SmootherConfig,
    StaticStartConfig,
    StationaryConfig,
)

__all__ = [
    "BackendConfig",
    "Config",
    "DatasetConfig",
    "DistributionConfig",
    "DynamicStartConfig",
    "EvaluationConfig",
    "FrontendConfig",
    "GivenStartConfig",
    "ImuConfig",
    "InitializationConfig",
    "MsckfConfig",
    "P2gdConfig",
    "PriorsConfig",
    "RuntimeConfig",
    "SceneConfig",
    "SmootherConfig",
    "StaticStartConfig",
    "StationaryConfig",
    "config_hash",
    "dump_yaml",
    "load_config",
    "override",
    "resolve",
]
