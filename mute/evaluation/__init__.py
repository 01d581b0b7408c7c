"""Trials, metrics, tables and figures."""
