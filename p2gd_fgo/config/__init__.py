"""Typed configuration: frozen models, YAML with ``extends:``, defaults that follow the image."""

from p2gd_fgo.config.loading import config_hash, dump_yaml, load_config, override, resolve
from p2gd_fgo.config.models import (
    BackendConfig,
    Config,
    DatasetConfig,
    DistributionConfig,
    EvaluationConfig,
    FrontendConfig,
    GivenStartConfig,
    ImuConfig,
    InitializationConfig,
    PriorsConfig,
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
    "EvaluationConfig",
    "FrontendConfig",
    "GivenStartConfig",
    "ImuConfig",
    "InitializationConfig",
    "PriorsConfig",
    "RuntimeConfig",
    "SmootherConfig",
    "StaticStartConfig",
    "StationaryConfig",
    "config_hash",
    "dump_yaml",
    "load_config",
    "override",
    "resolve",
]
