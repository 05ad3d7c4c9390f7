"""Readers of foreign session folders."""
