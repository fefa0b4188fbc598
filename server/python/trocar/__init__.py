"""Soft tissue that hands push, grasp and cut: organs, lessons, scenarios, sessions and recordings.

Lengths are in m, forces in N, masses in kg; a tick is 1 ms. Arrays are read-only."""

from trocar._engine import *  # noqa: F403
from trocar._engine import __version__  # noqa: F401
