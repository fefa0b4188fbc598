"""Spaces and the class of environments, as Gymnasium has them, for where Gymnasium is not installed."""

import numpy as np


class Space:
    """What an action or an observation may be. sample() takes it from a generator of the space's own."""

    def __init__(self, seed=None):
        self._random = None
        self.seed(seed)

    def seed(self, seed=None):
        """Begins the generator anew."""
        self._random = np.random.default_rng(seed)


class Box(Space):
    """Arrays of one shape and type between two limits, both within."""

    def __init__(self, low, high, shape=None, dtype=np.float32, seed=None):
        super().__init__(seed)
        self.dtype = np.dtype(dtype)
        self.shape = np.shape(low) if shape is None else tuple(shape)
        self.low = np.broadcast_to(np.asarray(low, self.dtype), self.shape)
        self.high = np.broadcast_to(np.asarray(high, self.dtype), self.shape)

    def sample(self):
        """One at random: uniform, and normal where there is no limit."""
        low, high = (np.where(np.isfinite(side), side, 0).astype(float) for side in (self.low, self.high))
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        if self.dtype.kind in "iu":
            return self._random.integers(low, high + 1).astype(self.dtype)
        return np.where(bounded, self._random.uniform(low, np.where(bounded, high, low)),
                        self._random.normal(size=self.shape)).astype(self.dtype)

    def contains(self, x):
        """Whether an array has shape, type and range of this space."""
        return (isinstance(x, np.ndarray) and x.shape == self.shape and np.can_cast(x.dtype, self.dtype) and
                bool(np.all(x >= self.low) and np.all(x <= self.high)))

    def __contains__(self, x):
        return self.contains(x)

    def __repr__(self):
        return f"Box({self.low.min() if self.low.size else 0}, {self.high.max() if self.high.size else 0}, " \
               f"{self.shape}, {self.dtype})"


class Dict(Space):
    """Dicts of one space for each key."""

    def __init__(self, spaces, seed=None):
        self.spaces = dict(spaces)
        super().__init__(seed)

    def seed(self, seed=None):
        """Begins the generators of all keys anew."""
        for number, space in enumerate(self.spaces.values()):
            space.seed(None if seed is None else seed + number)

    def sample(self):
        """One at random."""
        return {key: space.sample() for key, space in self.spaces.items()}

    def contains(self, x):
        """Whether a dict has these keys, each with a value of its space."""
        return isinstance(x, dict) and x.keys() == self.spaces.keys() and \
            all(space.contains(x[key]) for key, space in self.spaces.items())

    def __contains__(self, x):
        return self.contains(x)

    def __getitem__(self, key):
        return self.spaces[key]

    def __repr__(self):
        return f"Dict({self.spaces})"


class Env:
    """What gymnasium.Env gives: a generator, and what may be left out."""

    metadata = {"render_modes": []}
    render_mode = None
    spec = None
    np_random = None

    @property
    def unwrapped(self):
        """Itself."""
        return self

    def reset(self, *, seed=None, options=None):
        """Begins the generator anew where there is a seed, or where there is none yet."""
        if seed is not None or self.np_random is None:
            self.np_random = np.random.default_rng(seed)

    def close(self):
        """Gives back what it holds."""

    def __enter__(self):
        return self

    def __exit__(self, *args):
        self.close()
        return False
