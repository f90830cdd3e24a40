"""Rotations, poses, cameras and triangulation, batched over arrays."""
