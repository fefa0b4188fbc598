"""Episodes of tasks, and recordings, as arrays in files: NPZ, HDF5 and LeRobot's data sets.

    python3 -m trocar.episodes make trocar/Press-v0 presses --episodes 100
    python3 -m trocar.episodes make trocar/Press-v0 presses --format lerobot --pictures
    python3 -m trocar.episodes export lesson.mcap lesson.npz

`make` lets a scripted hand do a task, each episode with a seed of its own, and writes a file for each (npz), one file
with a group for each (hdf5, as robomimic has them), or a data set (lerobot, version 2.1). `export` writes one file.

An episode of n steps has n + 1 rows of what was seen: tick, state_hash, pose (tools x 7), force (tools x 3: N, of the
tissue on the tool), counts (nodes, tets, boundary triangles, free pieces), goal, surface, strain (greatest, and that
which a hundredth of the tets exceed: principal Green-Lagrange strain), and picture where it was asked for; and n rows
of action, reward, terminated and truncated. A recording has tick, state_hash, pose, force, and counts (surface
vertices and triangles); a tool that was away is not a number. Neither has stress, which the module does not give."""

import argparse
import json
import pathlib
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import trocar
from trocar import gym, parquet, picture, scene
from trocar.gym import scripted

FPS = 62.5
CHUNK = 1000  # episodes in a folder of a data set


def principal_strain(rest, positions, tets):
    """Greatest principal Green-Lagrange strain of each tet, float64 (tets).

    rest, positions: m (nodes x 3); tets: node numbers (tets x 4)."""
    tets = np.asarray(tets, np.int64)
    before, now = (np.asarray(places, float)[tets] for places in (rest, positions))
    before, now = (places[:, 1:] - places[:, :1] for places in (before, now))
    gradient = np.linalg.inv(before) @ now  # the transpose of dx/dX
    strain = 0.5 * (gradient @ gradient.transpose(0, 2, 1) - np.eye(3))
    # The greatest root of the characteristic polynomial, by its angle.
    mean = np.trace(strain, axis1=1, axis2=2) / 3
    rest_of = strain - mean[:, None, None] * np.eye(3)
    size = np.sqrt((rest_of * rest_of).sum(axis=(1, 2)) / 6)
    cosine = np.linalg.det(rest_of) / np.maximum(2 * size**3, 1e-300)
    return mean + 2 * size * np.cos(np.arccos(np.clip(cosine, -1, 1)) / 3)


def _row(env, state, info, has_picture):
    strain = principal_strain(env.session.rest_positions, env.session.positions, env.session.tets)
    row = {**state, "tick": np.uint64(info["tick"]), "state_hash": np.uint64(info["state_hash"]),
           "strain": np.array([strain.max(), np.quantile(strain, 0.99)], np.float32)}
    if has_picture:
        row["picture"] = env.render()
    return row


def run(env, hand, seed, *, has_picture=False):
    """An episode as a dict of arrays, as this module explains them. `env`: a Task that observes the state; `hand`: a
    function of an observation that gives an action. has_picture needs render_mode "rgb_array"."""
    state, info = env.reset(seed=seed)
    rows, steps, is_over = [_row(env, state, info, has_picture)], [], False
    while not is_over:
        action = np.asarray(hand(state), np.float32)
        state, reward, terminated, truncated, info = env.step(action)
        rows.append(_row(env, state, info, has_picture))
        steps.append({"action": action, "reward": np.float32(reward), "terminated": terminated,
                      "truncated": truncated})
        is_over = terminated or truncated
    return {key: np.stack([row[key] for row in part]) for part in (rows, steps) for key in part[0]}


def of_recording(recording):
    """Frames of a recording as a dict of arrays, as this module explains them. Raises Error where it is damaged."""
    hashes = dict(zip(recording.ticks().tolist(), recording.tick_hashes().tolist()))
    tools = scene.tools_by_tick(recording)
    slots = sorted({slot for row in tools.values() for slot, _, _ in row})
    ticks, counts, poses, forces = [], [], [], []
    for frame in recording.frames():
        pose, force = np.full((len(slots), 7), np.nan, np.float32), np.full((len(slots), 3), np.nan, np.float32)
        for slot, one, felt in tools.get(frame.tick, ()):
            pose[slots.index(slot)], force[slots.index(slot)] = one, felt
        ticks.append(frame.tick)
        counts.append((len(frame.positions), len(frame.triangles)))
        poses.append(pose)
        forces.append(force)
    if not ticks:
        raise ValueError("the recording has no frame")
    return {"tick": np.array(ticks, np.uint64), "slot": np.array(slots, np.int32), "pose": np.stack(poses),
            "state_hash": np.array([hashes.get(tick, 0) for tick in ticks], np.uint64), "force": np.stack(forces),
            "counts": np.array(counts, np.int64)}


# ---- NPZ and HDF5

def write_npz(folder, number, episode):
    """Writes an episode as episode_000000.npz into a folder."""
    np.savez_compressed(pathlib.Path(folder) / f"episode_{number:06d}.npz", **episode)


def _hdf5():
    try:
        import h5py
    except ImportError:
        raise ValueError("hdf5: h5py is missing, install python3-h5py") from None
    return h5py


def write_hdf5(path, episodes, task):
    """Writes episodes into one file, /data/demo_0 and so on: actions, rewards and dones (n rows), and in obs what was
    seen (n + 1 rows). Raises ValueError where h5py is missing."""
    with _hdf5().File(path, "w") as out:
        data = out.create_group("data")
        data.attrs["env"] = task
        for number, episode in enumerate(episodes):
            group = data.create_group(f"demo_{number}")
            group.attrs["num_samples"] = len(episode["action"])
            for key, values in (("actions", episode["action"]), ("rewards", episode["reward"]),
                                ("dones", episode["terminated"])):
                group.create_dataset(key, data=values)
            for key in sorted(episode.keys() - {"action", "reward", "terminated", "truncated"}):
                group.create_dataset(f"obs/{key}", data=episode[key], compression="gzip")


# ---- LeRobot

class LeRobot:
    """A data set of LeRobot 2.1 in a folder that is not there yet: a Parquet file for each episode, pictures in it as
    PNG, and what is in it as JSON. observation.state is pose and force of each tool, counts, and goal."""

    def __init__(self, folder, task):
        self._folder, self._task = pathlib.Path(folder), task
        (self._folder / "meta").mkdir(parents=True)
        self._lengths, self._stats, self._features = [], [], None

    def add(self, episode):
        """Writes an episode."""
        number, length = len(self._lengths), len(episode["action"])
        begin = sum(self._lengths)
        columns = {
            "observation.state": np.concatenate([episode[key][:-1].reshape(length, -1)
                                                 for key in ("pose", "force", "counts", "goal")], axis=1),
            "observation.strain": episode["strain"][:-1],
            "action": episode["action"],
            "next.reward": episode["reward"],
            "next.done": episode["terminated"] | episode["truncated"],
            "state_hash": [f"{one:016x}" for one in episode["state_hash"][:-1].tolist()],
            "timestamp": np.arange(length) / FPS,
            "frame_index": np.arange(length),
            "episode_index": np.full(length, number),
            "index": np.arange(begin, begin + length),
            "task_index": np.zeros(length, int),
        }
        if "picture" in episode:
            columns["observation.image"] = [picture.png(one) for one in episode["picture"][:-1]]
        if self._features is None:
            self._features = self._describe(columns, episode)
        folder = self._folder / f"data/chunk-{number // CHUNK:03d}"
        folder.mkdir(parents=True, exist_ok=True)
        parquet.write(folder / f"episode_{number:06d}.parquet", columns, metadata=self._for_datasets(columns))
        self._lengths.append(length)
        self._stats.append({key: self._stats_of(values) for key, values in columns.items()
                            if isinstance(values, np.ndarray)})

    @staticmethod
    def _stats_of(values):
        table = np.asarray(values, float).reshape(len(values), -1)
        return {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist(),
                "mean": table.mean(axis=0).tolist(), "std": table.std(axis=0).tolist(), "count": [len(table)]}

    @staticmethod
    def _type_of(values):
        if not isinstance(values, np.ndarray):
            return "image" if isinstance(values[0], bytes) else "string"
        return {"b": "bool", "i": "int64", "u": "int64", "f": "float32"}[values.dtype.kind]

    def _describe(self, columns, episode):
        features = {}
        for key, values in columns.items():
            kind = self._type_of(values)
            shape = [values.shape[1]] if kind not in ("image", "string") and values.ndim == 2 else [1]
            names = None
            if kind == "image":
                shape, names = list(episode["picture"].shape[1:]), ["height", "width", "channel"]
            features[key] = {"dtype": kind, "shape": shape, "names": names}
        return features

    def _for_datasets(self, columns):
        """What the package `datasets` asks for beside the columns."""
        features = {}
        for key, values in columns.items():
            kind = self._type_of(values)
            value = {"_type": "Image"} if kind == "image" else {"dtype": kind, "_type": "Value"}
            if isinstance(values, np.ndarray) and values.ndim == 2:
                value = {"feature": value, "length": values.shape[1], "_type": "Sequence"}
            features[key] = value
        return {"huggingface": json.dumps({"info": {"features": features}})}

    def end(self):
        """Writes what is in the data set. Raises ValueError where it has no episode."""
        if not self._lengths:
            raise ValueError(f"{self._folder}: there is no episode to write")
        count = len(self._lengths)
        info = {"codebase_version": "v2.1", "robot_type": "trocar", "total_episodes": count,
                "total_frames": sum(self._lengths), "total_tasks": 1, "total_videos": 0,
                "total_chunks": (count - 1) // CHUNK + 1, "chunks_size": CHUNK, "fps": FPS,
                "splits": {"train": f"0:{count}"}, "video_path": None,
                "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
                "features": self._features}
        meta = self._folder / "meta"
        (meta / "info.json").write_text(json.dumps(info, indent=2) + "\n")
        lines = {"tasks": [{"task_index": 0, "task": self._task}],
                 "episodes": [{"episode_index": number, "tasks": [self._task], "length": length}
                              for number, length in enumerate(self._lengths)],
                 "episodes_stats": [{"episode_index": number, "stats": stats}
                                    for number, stats in enumerate(self._stats)]}
        for name, rows in lines.items():
            (meta / f"{name}.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))


# ---- The program

def _episodes(options):
    """Episodes in order of their seeds, made by as many threads as there are environments."""
    envs = [gym.make(options.task, render_mode="rgb_array", size=(options.width, options.height),
                     **({} if options.seconds is None else {"seconds": options.seconds}))
            for _ in range(min(options.threads, options.episodes))]
    seeds = range(options.seed, options.seed + options.episodes)

    def one(env, seed):
        return run(env, scripted.HANDS[options.task](), seed, has_picture=options.pictures)

    with ThreadPoolExecutor(len(envs)) as pool:
        for begin in range(0, len(seeds), len(envs)):
            part = seeds[begin:begin + len(envs)]
            yield from pool.map(one, envs[:len(part)], part)


def _make(options):
    for name in ("episodes", "threads"):
        if getattr(options, name) < 1:
            raise ValueError(f"--{name}: is {getattr(options, name)}, must be 1 or more")
    out = pathlib.Path(options.out)
    if out.exists():
        raise ValueError(f"{out}: is there already, take another name")
    lengths, done = [], 0

    def counted():
        nonlocal done
        for episode in _episodes(options):
            lengths.append(len(episode["action"]))
            done += bool(episode["terminated"][-1])
            yield episode

    if options.format == "hdf5":
        write_hdf5(out, counted(), options.task)
    elif options.format == "npz":
        out.mkdir(parents=True)
        for number, episode in enumerate(counted()):
            write_npz(out, number, episode)
    else:
        data_set = LeRobot(out, options.task)
        for episode in counted():
            data_set.add(episode)
        data_set.end()
    print(f"{out}: {len(lengths)} episodes, {sum(lengths)} steps, {done} done")


def _export(options):
    out = pathlib.Path(options.out)
    if out.suffix not in (".npz", ".hdf5"):
        raise ValueError(f"{out}: ends in neither .npz nor .hdf5")
    with trocar.Recording(options.recording) as recording:
        arrays = of_recording(recording)
    if out.suffix == ".npz":
        np.savez_compressed(out, **arrays)
    else:
        with _hdf5().File(out, "w") as file:
            for key, values in arrays.items():
                file.create_dataset(key, data=values, compression="gzip")
    print(f"{out}: {len(arrays['tick'])} frames")


def main():
    parser = argparse.ArgumentParser(prog="python3 -m trocar.episodes", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="episodes of a scripted hand")
    make.add_argument("task", choices=sorted(scripted.HANDS))
    make.add_argument("out", help="folder, or file of hdf5, that is not there yet")
    make.add_argument("--episodes", type=int, default=100, help="[100]")
    make.add_argument("--format", choices=("npz", "hdf5", "lerobot"), default="npz", help="[npz]")
    make.add_argument("--seed", type=int, default=0, help="of the first episode [0]")
    make.add_argument("--seconds", type=float, help="simulated time of an episode at most [the task's own]")
    make.add_argument("--pictures", action="store_true", help="a picture for each step, too")
    make.add_argument("--width", type=int, default=128, help="of a picture, pixels [128]")
    make.add_argument("--height", type=int, default=96, help="of a picture, pixels [96]")
    make.add_argument("--threads", type=int, default=2, help="[2]")
    make.set_defaults(act=_make)
    export = commands.add_parser("export", help="the frames of a recording")
    export.add_argument("recording", help="file of a session or a scenario (.mcap)")
    export.add_argument("out", help="FILE.npz or FILE.hdf5")
    export.set_defaults(act=_export)
    options = parser.parse_args()
    try:
        options.act(options)
    except (ValueError, OSError, trocar.Error) as error:
        print(f"trocar.episodes: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
