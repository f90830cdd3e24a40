"""Simulated recordings with exact truth: routes, IMU, features, rendered images."""
