"""Recordings and moments as scenes of other programs: USD as text (.usda), and ParaView's series (.pvd, .vtu).

    python3 -m trocar.scene lesson.mcap lesson.usda --from 10 --to 20
    python3 -m trocar.scene lesson.mcap lesson.pvd --every 4
    python3 -m trocar.scene lesson.mcap moment.usda --at 12.5

Lengths are in m, y is up. A time code of USD is a frame, 16 ms; ParaView's time is in s. The tissue is its surface as
recorded, on a grid of 32 um. Each tool has its pose and the force of the tissue on it, N; its rod is a picture of a
tool, because a recording's frames do not have its shape."""

import argparse
import base64
import os
import pathlib
import sys

import numpy as np

import trocar

TICKS = 16  # of a frame
ROD_M, ROD_RADIUS_M = 0.15, 0.0025


class Moment:
    """What a scene shows at a tick: positions, m, float32 (vertices x 3); triangles, uint32 (triangles x 3), outward;
    tools, a list of (slot, pose as Session.pose() has it, force in N)."""

    def __init__(self, tick, positions, triangles, tools=()):
        self.tick, self.positions, self.triangles, self.tools = tick, positions, triangles, list(tools)

    @classmethod
    def of(cls, session, tools=((0, 0),)):
        """A session as it is, with the tools (hand, number) that are named."""
        triangles = session.triangles
        used, corners = np.unique(triangles, return_inverse=True)
        return cls(session.tick, session.positions[used], corners.reshape(-1, 3).astype(np.uint32),
                   [(2 * hand + tool, session.pose(hand, tool=tool), session.force(hand, tool=tool))
                    for hand, tool in tools])


def tools_by_tick(recording):
    """Tools of each recorded frame: dict of tick to a list of (slot, pose, force in N)."""
    columns = recording.tools()
    poses = np.stack([columns[key] for key in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")], axis=1)
    forces = np.stack([columns[key] for key in ("fx_n", "fy_n", "fz_n")], axis=1)
    tools = {}
    for tick, slot, pose, force in zip(columns["tick"].tolist(), columns["tool"].tolist(), poses, forces):
        tools.setdefault(tick, []).append((slot, pose, force))
    return tools


def moments_of(recording, start_s=0.0, stop_s=None, every=1):
    """Iterates over every so many frames of a recording between two times, s."""
    tools = tools_by_tick(recording)
    stop = None if stop_s is None else int(1000 * stop_s) + 1
    for number, frame in enumerate(recording.frames(int(1000 * start_s), stop)):
        if number % every == 0:
            yield Moment(frame.tick, frame.positions, frame.triangles, tools.get(frame.tick, ()))


class _Whole:
    """A file that is whole or not there: written under another name, and renamed."""

    def __init__(self, path):
        self._path, self._part = path, f"{path}.part"

    def __enter__(self):
        self._file = open(self._part, "w", encoding="ascii")
        return self._file

    def __exit__(self, kind, value, trace):
        self._file.close()
        if kind is None:
            os.replace(self._part, self._path)
        else:
            os.unlink(self._part)


# ---- USD

_HEAD = """#usda 1.0
(
    defaultPrim = "scene"
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = {start}
    endTimeCode = {end}
    timeCodesPerSecond = 62.5
    framesPerSecond = 62.5
)

def Xform "scene"
{{
"""
_ROD = """        def Cylinder "rod"
        {{
            uniform token axis = "Z"
            double height = {length}
            double radius = {radius}
            color3f[] primvars:displayColor = [(0.6, 0.62, 0.66)]
            double3 xformOp:translate = (0, 0, {middle})
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
"""


def _triples(array):
    return ", ".join("(%.6f, %.6f, %.6f)" % tuple(row) for row in array.tolist())


def _code(tick):
    return "%.10g" % (tick / TICKS)


class _Usda:
    """A scene that is written moment by moment. A mesh lasts until the triangles are others."""

    def __init__(self, out, first, last):
        self._out, self._first = out, first
        self._triangles = None
        self._count = 0
        self._tools = {}
        out.write(_HEAD.format(start=_code(first), end=_code(last)))

    def add(self, moment):
        if self._triangles is None or not np.array_equal(self._triangles, moment.triangles):
            self._end_mesh(moment.tick)
            self._begin_mesh(moment)
        self._low = np.minimum(self._low, moment.positions.min(axis=0))
        self._high = np.maximum(self._high, moment.positions.max(axis=0))
        self._out.write(f"            {_code(moment.tick)}: [{_triples(moment.positions)}],\n")
        for slot, pose, force in moment.tools:
            self._tools.setdefault(slot, []).append((moment.tick, pose, force))

    def end(self):
        self._end_mesh(None)
        for slot, samples in sorted(self._tools.items()):
            self._write_tool(slot, samples)
        self._out.write("}\n")

    def _begin_mesh(self, moment):
        self._triangles, self._begin = moment.triangles, moment.tick
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._out.write(f'    def Mesh "tissue_{self._count}"\n    {{\n'
                        '        uniform token subdivisionScheme = "none"\n'
                        '        uniform bool doubleSided = 1\n'
                        '        color3f[] primvars:displayColor = [(0.8, 0.47, 0.43)]\n'
                        f'        int[] faceVertexCounts = [{", ".join(["3"] * len(moment.triangles))}]\n'
                        f'        int[] faceVertexIndices = [{", ".join(map(str, moment.triangles.ravel().tolist()))}]\n'
                        '        point3f[] points.timeSamples = {\n')
        self._count += 1

    def _end_mesh(self, tick):
        """`tick`: of the moment that shows another mesh; None: there is none."""
        if self._triangles is None:
            return
        samples = [(self._first, "invisible")] if self._begin > self._first else []
        samples.append((self._begin, "inherited"))
        if tick is not None:
            samples.append((tick, "invisible"))
        shown = ", ".join(f'{_code(at)}: "{word}"' for at, word in samples)
        self._out.write(f"        }}\n        float3[] extent = [{_triples(np.stack([self._low, self._high]))}]\n"
                        f"        token visibility.timeSamples = {{ {shown} }}\n    }}\n")

    def _write_tool(self, slot, samples):
        def attribute(name, values):
            body = "".join(f"            {_code(tick)}: {value},\n" for (tick, _, _), value in zip(samples, values))
            return f"        {name}.timeSamples = {{\n{body}        }}\n"

        self._out.write(f'    def Xform "tool_{slot}"\n    {{\n')
        self._out.write(attribute("custom float3 trocar:force_n", (_triples(force[None]) for _, _, force in samples)))
        self._out.write(attribute("float3 xformOp:translate", (_triples(pose[None, :3]) for _, pose, _ in samples)))
        # USD has the real part first.
        self._out.write(attribute("quatf xformOp:orient", (
            "(%.7g, %.7g, %.7g, %.7g)" % (pose[6], pose[3], pose[4], pose[5]) for _, pose, _ in samples)))
        self._out.write('        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]\n')
        self._out.write(_ROD.format(length=ROD_M, radius=ROD_RADIUS_M, middle=ROD_M / 2) + "    }\n")


def write_usda(path, moments, first=None, last=None):
    """Writes moments in order as USD text. Returns how many there were. `first`, `last`: ticks that they lie between;
    those of the list without them.

    Where a cut changes the triangles, another mesh, tissue_1 and so on, becomes visible in place of the one before.
    Raises ValueError where there is no moment."""
    count = 0
    if first is None or last is None:
        moments = list(moments)
        first, last = (moments[0].tick, moments[-1].tick) if moments else (0, 0)
    with _Whole(path) as out:
        scene = _Usda(out, first, last)
        for moment in moments:
            scene.add(moment)
            count += 1
        if count == 0:
            raise ValueError(f"{path}: there is no moment to write")
        scene.end()
    return count


# ---- ParaView

_TYPES = {"f": "Float", "u": "UInt", "i": "Int"}


def _data_array(name, array):
    array = np.ascontiguousarray(array)
    kind = f"{_TYPES[array.dtype.kind]}{8 * array.dtype.itemsize}"
    columns = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
    data = base64.b64encode(np.uint32(array.nbytes).tobytes() + array.tobytes()).decode()
    return f'<DataArray type="{kind}" Name="{name}"{columns} format="binary">{data}</DataArray>\n'


def write_vtu(path, positions, cells, *, point_data=None, cell_data=None):
    """Writes a grid of points (1 column), triangles (3) or tets (4) for ParaView: XML with binary arrays.

    `positions`: m (vertices x 3); `cells`: vertex numbers (cells x corners); data by name, a row a vertex or cell."""
    cells = np.asarray(cells)
    corners = cells.shape[1]
    kind = {1: 1, 3: 5, 4: 10}[corners]
    with _Whole(path) as out:
        out.write('<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" '
                  'header_type="UInt32">\n<UnstructuredGrid>\n'
                  f'<Piece NumberOfPoints="{len(positions)}" NumberOfCells="{len(cells)}">\n<Points>\n')
        out.write(_data_array("Points", np.asarray(positions, np.float32)) + "</Points>\n<Cells>\n")
        out.write(_data_array("connectivity", cells.astype(np.int32).ravel()))
        out.write(_data_array("offsets", np.arange(corners, corners * len(cells) + 1, corners, dtype=np.int32)))
        out.write(_data_array("types", np.full(len(cells), kind, np.uint8)) + "</Cells>\n")
        for tag, data in (("PointData", point_data), ("CellData", cell_data)):
            out.write(f"<{tag}>\n" + "".join(_data_array(*one) for one in (data or {}).items()) + f"</{tag}>\n")
        out.write("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")


def write_pvd(path, moments):
    """Writes moments as a series: a .pvd file, and a folder beside it with two .vtu files a moment, the surface and
    the tools as points with slot and force_n. Returns how many there were. Raises ValueError where there is none."""
    path = pathlib.Path(path)
    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    lines = []
    for moment in moments:
        surface, tools = f"surface_{moment.tick:08d}.vtu", f"tools_{moment.tick:08d}.vtu"
        write_vtu(folder / surface, moment.positions, moment.triangles)
        poses = np.array([pose for _, pose, _ in moment.tools], np.float32).reshape(-1, 7)
        forces = np.array([force for _, _, force in moment.tools], np.float32).reshape(-1, 3)
        write_vtu(folder / tools, poses[:, :3], np.arange(len(poses))[:, None], point_data={
            "force_n": forces, "slot": np.array([slot for slot, _, _ in moment.tools], np.int32)})
        lines += [f'<DataSet timestep="{moment.tick / 1000:g}" part="{part}" file="{folder.name}/{name}"/>\n'
                  for part, name in enumerate((surface, tools))]
    if not lines:
        raise ValueError(f"{path}: there is no moment to write")
    with _Whole(path) as out:
        out.write('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
                  "<Collection>\n" + "".join(lines) + "</Collection>\n</VTKFile>\n")
    return len(lines) // 2


def _write(options):
    out = pathlib.Path(options.out)
    if out.suffix not in (".usda", ".pvd"):
        raise ValueError(f"{out}: ends in neither .usda nor .pvd")
    if options.every < 1:
        raise ValueError(f"--every: is {options.every}, must be 1 or more")
    start, stop = options.start, options.stop
    if start < 0 or (stop is not None and stop < start):
        raise ValueError("--from, --to: must be 0 or more, and --to not before --from")
    with trocar.Recording(options.recording) as recording:
        if options.at is not None:
            frame = recording.seek(int(1000 * options.at))
            moments = [Moment(frame.tick, frame.positions, frame.triangles,
                              tools_by_tick(recording).get(frame.tick, ()))]
            first = last = frame.tick
        else:
            first = max(int(1000 * start), TICKS)
            last = min(recording.last_tick, int(1000 * stop) if stop is not None else recording.last_tick)
            moments = moments_of(recording, start, stop, options.every)
        return write_pvd(out, moments) if out.suffix == ".pvd" else write_usda(out, moments, first, last)


def main():
    parser = argparse.ArgumentParser(prog="python3 -m trocar.scene", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", help="file of a session or a scenario (.mcap)")
    parser.add_argument("out", help="what to write: FILE.usda or FILE.pvd")
    parser.add_argument("--from", dest="start", type=float, default=0.0, metavar="S", help="simulated time [0]")
    parser.add_argument("--to", dest="stop", type=float, metavar="S", help="simulated time [the end]")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each Nth frame of 16 ms [1]")
    parser.add_argument("--at", type=float, metavar="S", help="only the moment at or before this time")
    options = parser.parse_args()
    try:
        count = _write(options)
    except (ValueError, OSError, trocar.Error) as error:
        print(f"trocar.scene: {error}", file=sys.stderr)
        return 1
    print(f"{options.out}: {count} moment{'' if count == 1 else 's'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
