"""Estimators behind one contract (:mod:`p2gd_fgo.backends.base`)."""
