"""Tasks with one tool: reach, press, lift, cut along a line, dissect."""

import numpy as np

from trocar.gym.base import STEP_S, Task, outward

UP = np.array([0.0, 0.0, 1.0])
BONUS = 10.0  # of a task that is done


class Held:
    """For how long something has been so without a break, s."""

    def __init__(self):
        self.seconds = 0.0

    def see(self, is_so):
        """Counts a step; returns the time."""
        self.seconds = self.seconds + STEP_S if is_so else 0.0
        return self.seconds


class Reach(Task):
    """Bring the tip of a probe to a point in the air above the liver, without touching.

    goal (3): the point less the tip, m. Reward of a step: -d / 100 mm - |F| / 1 N, d the distance of the tip from
    the point and F the force of the tissue; 10 more when d has been below 3 mm for 0.1 s, which ends it. Measures:
    distance_m, force_n."""

    goal_size = 3

    def _begin(self):
        top = self.organ.nodes[:, 2].max()
        low, high = np.array([-0.05, -0.03, top + 0.015]), np.array([0.05, 0.05, top + 0.06])
        self._point, tip = self.np_random.uniform(low, high), self.np_random.uniform(low, high)
        self._near = Held()
        self._goal = self._point - tip
        return [(tip, UP)]

    def _look(self):
        self._goal = self._point - self.tip()
        distance, force = np.linalg.norm(self._goal), np.linalg.norm(self.force())
        is_done = self._near.see(distance < 0.003) >= 0.1
        return (-distance / 0.1 - force + BONUS * is_done, is_done,
                {"is_success": is_done, "distance_m": float(distance), "force_n": float(force)})


class Press(Task):
    """Press a place on the front of the liver with a probe until it pushes back with a force that is asked for.

    goal (7): the place at rest less the tip, m; the tissue's normal there; the force asked for, f*, 0.2 to 0.5 N.
    Reward of a step: -min(3, |f - f*| / f*) - s / 10 mm - g / 10 mm, f the force on the probe along the normal, s how
    far the tip is aside from the normal through the place, g how far it is outside while nothing is felt; 10 more
    when |f - f*| has been below 0.1 f* for 0.3 s, which ends it. Measures: force_n, asked_n, aside_m."""

    goal_size = 7

    def __init__(self, **options):
        super().__init__(**options)
        nodes, normals = outward(self.organ)
        fixed = self.organ.nodes[self.organ.fixed_nodes]
        places = self.organ.nodes[nodes]
        # The front, away from the rim and from what is held.
        front = (normals[:, 2] > 0.9) & (np.abs(places[:, 0]) < 0.06)
        if len(fixed):
            front &= np.array([np.linalg.norm(fixed - place, axis=1).min() > 0.02 for place in places])
        if not front.any():
            raise ValueError("organ: has no place on its front to press, take the liver")
        self._places, self._normals = places[front], normals[front]

    def _begin(self):
        which = self.np_random.integers(len(self._places))
        self._place, self._normal = self._places[which], self._normals[which]
        self._asked = self.np_random.uniform(0.2, 0.5)
        tip = self._place + 0.008 * self._normal + self.np_random.uniform(-0.003, 0.003, 3)
        self._held = Held()
        self._goal = np.concatenate([self._place - tip, self._normal, [self._asked]])
        return [(tip, self._normal)]

    def _look(self):
        away = self.tip() - self._place
        height = away @ self._normal
        aside = np.linalg.norm(away - height * self._normal)
        felt = self.force()
        force = felt @ self._normal
        gap = max(height, 0.0) if not felt.any() else 0.0
        error = abs(force - self._asked) / self._asked
        is_done = self._held.see(error < 0.1) >= 0.3
        self._goal = np.concatenate([-away, self._normal, [self._asked]])
        return (-min(3.0, error) - aside / 0.01 - gap / 0.01 + BONUS * is_done, is_done,
                {"is_success": is_done, "force_n": float(force), "asked_n": float(self._asked),
                 "aside_m": float(aside)})


class Lift(Task):
    """Grasp the lower edge of the liver, draw it 15 mm away, and hold it there for a second with 2 N at most.

    The fourth number of an action closes the jaws while it is above 0. goal (5): where the edge is now less the tip,
    m; how far the edge is from where it was, m; whether the jaws hold (0 or 1). Reward of a step: -d / 100 mm while
    nothing is held, and else min(l, 15 mm) / 15 mm - max(0, |F| - 2 N) / 1 N; d is the distance of the tip from the
    edge, l how far the edge has been lifted. 10 more when l has been 15 mm with 2 N at most for 1 s, which ends it.
    Measures: lifted_m, force_n."""

    instruments = ("grasper",)
    is_always_used = False
    goal_size = 5
    LIFT_M, LIMIT_N = 0.015, 2.0

    def _begin(self):
        surface = np.unique(self.organ.surface)
        rest = self.organ.nodes
        self._edge = surface[np.argmax(rest[surface] @ [0, -1, 0.9])]
        tip = rest[self._edge] + [0, -0.012, 0.012] + self.np_random.uniform(-0.004, 0.004, 3)
        self._held = Held()
        self._find(tip)
        return [(tip, np.array([-0.6, -0.25, 1.0]))]

    def _find(self, tip):
        now = self.session.positions[self._edge].astype(float)
        lifted = np.linalg.norm(now - self.organ.nodes[self._edge])
        self._goal = np.concatenate([now - tip, [lifted, float(self.is_at_work())]])
        return lifted

    def _look(self):
        lifted, force = self._find(self.tip()), np.linalg.norm(self.force())
        is_held = bool(self._goal[4])
        is_done = self._held.see(is_held and lifted >= self.LIFT_M and force <= self.LIMIT_N) >= 1.0
        reward = min(lifted, self.LIFT_M) / self.LIFT_M - max(0.0, force - self.LIMIT_N) if is_held \
            else -np.linalg.norm(self._goal[:3]) / 0.1
        return (reward + BONUS * is_done, is_done,
                {"is_success": is_done, "lifted_m": float(lifted), "force_n": float(force)})


class CutLine(Task):
    """Cut the front of the liver with a scalpel along a line of 40 mm, 5 mm deep.

    The fourth number of an action makes it cut while it is above 0. goal (10): both ends of the line at rest less the
    tip, m; the tissue's normal; the part of the line that is cut. Reward of a step: 20 c - 1 w / cm^2 - max(0, |F| -
    2 N) / 1 N - 0.01, c how much more of the line is cut to the depth within 4 mm, as lessons measure it, and w how
    much wound is made farther away than that (both sides); 10 more when nine tenths of the line are cut, which ends it.
    Measures: covered (0 to 1), error_m, stray_m2, force_n."""

    instruments = ("scalpel",)
    is_always_used = False
    goal_size = 10
    DEPTH_M, TOLERANCE_M = 0.005, 0.004

    def __init__(self, **options):
        super().__init__(**options)
        nodes, normals = outward(self.organ)
        front = normals[:, 2] > 0.5
        self._places, self._normals = self.organ.nodes[nodes][front], normals[front]

    def _front_at(self, x, y):
        """The place of the surface before x and y, from the three nearest of its nodes, m."""
        away = np.linalg.norm(self._places[:, :2] - [x, y], axis=1)
        nearest = np.argsort(away, kind="stable")[:3]
        return np.array([x, y, np.average(self._places[nearest, 2], weights=1 / (away[nearest] + 1e-6))])

    def _begin(self):
        x, y = self.np_random.uniform([-0.03, 0.015], [0.0, 0.03])
        self._line = np.array([self._front_at(x + dx, y) for dx in (0, 0.01, 0.02, 0.03, 0.04)])
        self._edits, self._cut = 0, {"covered": 0.0, "error": 0.0, "stray": 0.0}
        tip = self._line[0] + [-0.004, 0, 0.006]
        self._see(tip)
        return [(tip, np.array([0.2, -0.3, 1.0]))]

    def _see(self, tip):
        self._goal = np.concatenate([self._line[0] - tip, self._line[-1] - tip, UP, [self._cut["covered"]]])

    def _look(self):
        before, edits = self._cut, self.session.counts()["edits"]
        if edits != self._edits:
            self._edits = edits
            self._cut = self.session.incision(self._line, depth=self.DEPTH_M, tolerance=self.TOLERANCE_M)
        force = np.linalg.norm(self.force())
        more = self._cut["covered"] - before["covered"]
        stray_cm2 = 1e4 * (self._cut["stray"] - before["stray"])
        is_done = self._cut["covered"] >= 0.9
        self._see(self.tip())
        return (20 * more - stray_cm2 - max(0.0, force - 2.0) - 0.01 + BONUS * is_done, is_done,
                {"is_success": is_done, "covered": self._cut["covered"], "error_m": self._cut["error"],
                 "stray_m2": self._cut["stray"], "force_n": float(force)})


class Dissect(Task):
    """Take off the end of the liver's thin lobe with a long blade, 18 to 25 mm of it, so that it comes free.

    The fourth number of an action makes the blade cut while it is above 0. goal (6): where a stroke through the lobe
    begins and where it ends, less the tip, m; the blade's edge runs from the tip up along z. Reward of a step: a / cm^2
    - w / cm^2 - max(0, |F| - 12 N) / 1 N - 0.01, a the wound made within 4 mm of the stroke's plane and w that made
    elsewhere, at rest, both sides; 10 more when a piece is free, which ends it. Measures: pieces, wound_m2, stray_m2,
    force_n."""

    instruments = ("knife",)
    is_always_used = False
    goal_size = 6
    TOLERANCE_M = 0.004

    def _begin(self):
        nodes = self.organ.nodes
        self._plane_m = nodes[:, 0].max() - self.np_random.uniform(0.018, 0.025)
        low, high = (pick(nodes[nodes[:, 0] > self._plane_m - 0.006], axis=0) for pick in (np.min, np.max))
        self._ends = np.array([[self._plane_m, high[1] + 0.004, low[2] - 0.004],
                               [self._plane_m, low[1] - 0.004, low[2] - 0.004]])
        self._edits, self._wound = 0, (0.0, 0.0)
        tip = self._ends[0] + [0, 0.01, 0] + self.np_random.uniform(-0.002, 0.002, 3)
        self._goal = (self._ends - tip).ravel()
        return [(tip, UP)]

    def _wounds(self):
        """Area of the wound near the plane of the stroke, and elsewhere, m^2."""
        corners = self.session.rest_positions[self.session.triangles[self.session.wounds].astype(np.int64)]
        areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        near = np.abs(corners.mean(axis=1)[:, 0] - self._plane_m) < self.TOLERANCE_M
        return float(areas[near].sum()), float(areas[~near].sum())

    def _look(self):
        before, counts = self._wound, self.session.counts()
        if counts["edits"] != self._edits:
            self._edits, self._wound = counts["edits"], self._wounds()
        force = np.linalg.norm(self.force())
        is_done = counts["pieces"] > 0
        self._goal = (self._ends - self.tip()).ravel()
        made, stray = (1e4 * (now - then) for now, then in zip(self._wound, before))
        return (made - stray - max(0.0, force - 12.0) - 0.01 + BONUS * is_done, is_done,
                {"is_success": is_done, "pieces": counts["pieces"], "wound_m2": self._wound[0],
                 "stray_m2": self._wound[1], "force_n": float(force)})
