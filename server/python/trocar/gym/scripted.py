"""Hands that do the tasks by rule, from the state alone: for episodes to learn from, and as a mark to beat."""

import numpy as np

FULL_M = 0.001  # an action of 1


def _toward(away_m, speed=0.5):
    """An action that goes a way, at most at this part of full speed."""
    action = np.asarray(away_m, float) / FULL_M
    return action * min(1.0, speed / max(np.linalg.norm(action), 1e-12))


def reach(state):
    """Straight to the point."""
    return _toward(state["goal"], 0.9)


def press(state):
    """Along the normal, faster while nothing is felt; then by how much force is missing."""
    away, normal, asked = state["goal"][:3].astype(float), state["goal"][3:6].astype(float), float(state["goal"][6])
    force = float(state["force"][0] @ normal)
    aside = away - (away @ normal) * normal
    along = -0.6 if force <= 0 else np.clip(1.5 * (force - asked) / asked, -0.5, 0.5)
    return np.clip(_toward(aside, 0.3) + along * normal, -1, 1)


def lift(state):
    """To the edge with open jaws, then closed, and slowly up and forward."""
    away, lifted, holds = state["goal"][:3].astype(float), float(state["goal"][3]), state["goal"][4] > 0
    if holds:
        pull = np.array([0, 0.6, 0.8]) * (0.25 if lifted < 0.0155 else 0.0)
        return np.append(pull, 1.0)
    return np.append(_toward(away, 0.5), 1.0 if np.linalg.norm(away) < 0.004 else -1.0)


class CutLine:
    """In at the first end, along the line at a depth, out beyond the other."""

    def __init__(self):
        self._is_in = False

    def __call__(self, state):
        to_begin, to_end = state["goal"][:3].astype(float), state["goal"][3:6].astype(float)
        along = to_end - to_begin
        flat = along / np.linalg.norm(along)
        into = -np.array([0, 0, 1.0]) * 0.008
        if not self._is_in:
            way = to_begin - 0.004 * flat + into
            self._is_in = np.linalg.norm(way) < 0.001
            return np.append(_toward(way, 0.4), 1.0)
        return np.append(_toward(to_end + 0.006 * flat + into, 0.4), 1.0)


class Dissect:
    """To where the stroke begins, and through the lobe to beyond its end."""

    def __init__(self):
        self._is_in = False

    def __call__(self, state):
        to_begin, to_end = state["goal"][:3].astype(float), state["goal"][3:].astype(float)
        if not self._is_in:
            self._is_in = np.linalg.norm(to_begin) < 0.001
            return np.append(_toward(to_begin, 0.5), -1.0)
        return np.append(_toward(to_end + [0, -0.01, 0], 0.5), 1.0)


# By task: what gives a hand for an episode.
HANDS = {
    "trocar/Reach-v0": lambda: reach,
    "trocar/Press-v0": lambda: press,
    "trocar/Lift-v0": lambda: lift,
    "trocar/CutLine-v0": CutLine,
    "trocar/Dissect-v0": Dissect,
}
