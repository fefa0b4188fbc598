#!/usr/bin/env python3
"""Writes files with other programs' writers, imports each, and compares what comes out with what went in.

    foreign_files.py BIN

BIN has trocar-organ. The writers are those of meshio and pydicom, and where they are installed those of VTK, Gmsh and
nibabel. Meshes are a block of 40 x 30 x 20 mm with three regions, maps an ellipsoid with a ball.
Exit code: 1 if a file comes out otherwise, 77 without numpy, meshio or pydicom.
"""

import contextlib
import importlib
import io
import itertools
import json
import pathlib
import re
import subprocess
import sys
import tempfile

try:
    import meshio
    import numpy as np
    import pydicom
except ImportError as missing:
    print(f"SKIPPED: {missing} (deploy/setup --with-tests)", file=sys.stderr)
    sys.exit(77)


def block():
    """Nodes in mm, tets and their labels: six tets in each of 4 x 3 x 2 boxes."""
    counts, step = np.array([4, 3, 2]), 10.0
    places = np.array([[x, y, z] for z in range(3) for y in range(4) for x in range(5)]) * step
    tets, labels = [], []
    for box in itertools.product(*map(range, counts)):
        for order in itertools.permutations(range(3)):
            corner, tet = np.array(box), []
            for axis in (None, *order):
                if axis is not None:
                    corner[axis] += 1
                tet.append(corner @ (1, 5, 20))
            tets.append(tet)
            labels.append(1 if box[0] < 2 else 2 if box[1] < 2 else 5)
    return places, np.array(tets), np.array(labels)


NODES, TETS, LABELS = block()
TRIANGLES, LINES = np.array([[0, 1, 6], [1, 7, 6]]), np.array([[0, 1]])
VOXELS = (30, 26, 22)


def ellipsoid():
    """Labels by column, row and slice: 1 around a ball of 2, which is off the middle on each axis."""
    at = np.stack(np.meshgrid(*map(np.arange, VOXELS), indexing="ij"), -1) - (np.array(VOXELS) - 1) / 2
    labels = (((at / (12.5, 10.5, 8.5)) ** 2).sum(-1) <= 1).astype(int)
    labels[((at - (4, 2, 1)) ** 2).sum(-1) <= 4.6**2] = 2
    return labels


MAP = ellipsoid()


def turned(axis, degrees):
    """The matrix that turns around an axis."""
    cosine, sine = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    i, j = (k for k in range(3) if k != axis)
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = cosine
    matrix[i, j], matrix[j, i] = -sine, sine
    return matrix


def wanted_of_block():
    volumes = np.abs(np.linalg.det(NODES[TETS[:, 1:]] - NODES[TETS[:, :1]])) / 6e3
    return {"tets": len(TETS), "nodes": len(NODES), "box": ([0, 0, 0], [40, 30, 20]),
            "ml": [volumes[LABELS == label].sum() for label in (1, 2, 5)]}


def wanted_of_map(place, to_organ):
    """place: from voxels to the file's coordinates in mm. to_organ: from those to left, head, front."""
    matrix = to_organ @ place[:3]
    centres = [np.append(np.argwhere(MAP == label).mean(0), 1) @ matrix.T for label in (1, 2)]
    return {"centres": centres, "voxel": np.linalg.norm(matrix[:, :3], axis=0).max(),
            "ml": [(MAP == label).sum() * abs(np.linalg.det(matrix[:, :3])) / 1e3 for label in (1, 2)]}


FROM_RAS = np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]])
FROM_LPS = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


class Files:
    """Files to be imported: name, options, what must come out, and what must be said."""

    def __init__(self, folder):
        self.folder, self.cases = folder, []

    def add(self, name, write, wanted, options="--unit mm", says="", refused=""):
        with contextlib.redirect_stdout(io.StringIO()):
            write(self.folder / name)
        self.cases.append((name, options, wanted, says, refused))


def add_meshes(files):
    """Meshes that meshio writes."""
    def mesh(**more):
        return meshio.Mesh(NODES, [("tetra", TETS[:50]), ("triangle", TRIANGLES), ("tetra", TETS[50:]),
                                   ("line", LINES)], **more)

    def labels(number=int, beside=0):
        return [LABELS[:50].astype(number), np.full(2, beside, number), LABELS[50:].astype(number),
                np.full(1, beside, number)]

    rest = {"u": np.ones((60, 3)), "p": np.ones(60)}
    for binary, ending in ((False, "text"), (True, "binary")):
        numbers = {"gmsh:physical": labels(beside=7), "gmsh:geometrical": labels(beside=7)}
        files.add(f"{ending}.msh", lambda path: mesh(
            cell_data={**numbers, "heat": labels(float)}, point_data=rest,
            field_data={"hilum": np.array([7, 2]), "a b": np.array([1, 3])}).write(
                path, file_format="gmsh22", binary=binary), wanted_of_block(), says="'.NodeData', '.ElementData'")
        for version, kinds in (("vtk42", "i4 i8 f4 f8"), ("vtk", "i1 u1 i2 u2 i4 u4 i8 u8 f4 f8")):
            for kind in kinds.split():
                files.add(f"{version}-{ending}-{kind}.vtk", lambda path: mesh(
                    cell_data={"label": labels(kind), "heat": labels("f8")}, point_data=rest).write(
                        path, file_format=version, binary=binary), wanted_of_block(), says="'u'.*'heat'")
    for packing, header, binary in ((None, "UInt32", False), (None, "UInt32", True), (None, "UInt64", True),
                                    ("zlib", "UInt32", True), ("zlib", "UInt64", True), ("lzma", "UInt32", True)):
        files.add(f"{packing}-{header}-{binary}.vtu", lambda path: meshio.vtu.write(
            path, mesh(cell_data={"region": labels()}, point_data=rest), binary=binary, compression=packing,
            header_type=header), wanted_of_block(), says="'u'", refused="vtkLZMA" if packing == "lzma" else "")
    for kind in ("f4", "i1", "u8"):
        files.add(f"{kind}.vtu", lambda path: mesh(cell_data={"MaterialIds": labels(kind)}).write(path),
                  wanted_of_block())
    files.add("sets.inp", lambda path: meshio.Mesh(
        NODES, [("tetra", TETS), ("triangle", TRIANGLES)],
        cell_sets={f"part{label}": [np.where(LABELS == label)[0], []] for label in (5, 1, 2)},
        point_sets={"top": np.where(NODES[:, 2] == 20)[0]}).write(path), wanted_of_block(),
              "--unit mm --fix set:top", says=r"fixed nodes +20 ")
    files.add("references.mesh", lambda path: mesh(cell_data={"medit:ref": labels()}).write(path), wanted_of_block())
    files.add("attributes.node", lambda path: meshio.Mesh(
        NODES, [("tetra", TETS)], cell_data={"tetgen:ref": [LABELS]}).write(path, file_format="tetgen"),
              wanted_of_block())
    for name, version in (("hex.msh", "gmsh22"), ("hex.vtk", "vtk"), ("hex.vtu", "vtu"), ("hex.inp", "abaqus")):
        files.add(name, lambda path: meshio.Mesh(NODES, [("hexahedron", [[0, 1, 6, 5, 20, 21, 26, 25]])]).write(
            path, file_format=version), None, refused="not supported")


def add_vtk(files):
    """Meshes with data of each kind that VTK writes."""
    core = importlib.import_module("vtkmodules.vtkCommonCore")
    model = importlib.import_module("vtkmodules.vtkCommonDataModel")
    legacy = importlib.import_module("vtkmodules.vtkIOLegacy")
    xml = importlib.import_module("vtkmodules.vtkIOXML")
    as_vtk = importlib.import_module("vtkmodules.util.numpy_support").numpy_to_vtk

    def array(values, name):
        found = as_vtk(np.ascontiguousarray(values), deep=1)
        found.SetName(name)
        return found

    def listed(kind, name, values):
        found = kind()
        found.SetName(name)
        for value in values:
            found.InsertNextValue(value)
        return found

    def grid(add=lambda points, cells: None):
        found, points = model.vtkUnstructuredGrid(), core.vtkPoints()
        points.SetData(array(NODES, "places"))
        found.SetPoints(points)
        for tet in TETS:
            ids = core.vtkIdList()
            for node in tet:
                ids.InsertNextId(int(node))
            found.InsertNextCell(10, ids)
        found.GetCellData().SetScalars(array(LABELS, "label"))
        add(found.GetPointData(), found.GetCellData())
        return found

    kinds = {
        "texts": lambda points, cells: cells.AddArray(
            listed(core.vtkStringArray, "x", ["a" * (i % 70) for i in range(len(TETS))])),
        "bits": lambda points, cells: cells.AddArray(listed(core.vtkBitArray, "x", LABELS % 2)),
        "places": lambda points, cells: points.SetTCoords(array(np.ones((60, 2)), "x")),
        "colours": lambda points, cells: points.SetScalars(array(np.ones((60, 3), "u1"), "x")),
        "numbers": lambda points, cells: (points.SetGlobalIds(array(np.arange(60), "x")),
                                          cells.SetPedigreeIds(array(np.arange(144), "y"))),
        "tensors": lambda points, cells: (points.SetTensors(array(np.ones((60, 9)), "x")),
                                          cells.SetTensors(array(np.ones((144, 6)), "y"))),
    }
    for (kind, add), binary, version in itertools.product(kinds.items(), (0, 1), (42, 51)):
        def write(path):
            writer = legacy.vtkUnstructuredGridWriter()
            writer.SetInputData(grid(add))
            writer.SetFileVersion(version)
            writer.SetFileType(1 + binary)
            writer.SetFileName(str(path))
            writer.Write()
        files.add(f"vtk-{kind}-{version}-{binary}.vtk", write, wanted_of_block(), says="'x'")
    for (mode, packing, encoded), order in itertools.product(
            (("Ascii", "None", 0), ("Binary", "None", 0), ("Binary", "ZLib", 0), ("Appended", "None", 0),
             ("Appended", "ZLib", 0), ("Appended", "None", 1), ("Appended", "ZLib", 1)), ("Little", "Big")):
        def write(path):
            writer = xml.vtkXMLUnstructuredGridWriter()
            writer.SetInputData(grid(kinds["colours"]))
            getattr(writer, f"SetDataModeTo{mode}")()
            getattr(writer, f"SetCompressorTypeTo{packing}")()
            getattr(writer, f"SetByteOrderTo{order}Endian")()
            writer.SetEncodeAppendedData(encoded)
            writer.SetNumberOfPieces(1 if encoded else 3)
            writer.SetFileName(str(path))
            writer.Write()
        files.add(f"vtk-{mode}-{packing}-{encoded}-{order}.vtu", write, wanted_of_block(), says="'x'")


def add_gmsh(files):
    """Two boxes in each version of Gmsh's files, one of them in two groups."""
    gmsh = importlib.import_module("gmsh")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    occ, model = gmsh.model.occ, gmsh.model
    occ.fragment([(3, occ.addBox(0, 0, 0, 20, 30, 20))], [(3, occ.addBox(20, 0, 0, 20, 30, 20))])
    occ.synchronize()
    for number, name, volumes in ((11, "left", [1]), (12, "right", [2]), (13, "tumour", [2])):
        model.addPhysicalGroup(3, volumes, number)
        model.setPhysicalName(3, number, name)
    model.addPhysicalGroup(2, [1], 7)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 12)
    model.mesh.generate(3)
    wanted = {"tets": sum(len(found) for found in model.mesh.getElements(3)[1]),
              "nodes": len(model.mesh.getNodes()[0]), "box": ([0, 0, 0], [40, 30, 20]), "ml": [12, 12]}
    for version, binary in ((1, 0), (2.2, 0), (2.2, 1), (4.1, 0), (4.1, 1)):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        files.add(f"gmsh-{version}-{binary}.msh", lambda path: gmsh.write(str(path)), wanted,
                  says=r"keep fewer: '(right|region 12): 0 of ")
    gmsh.option.setNumber("Mesh.Binary", 0)
    for ending in ("inp", "vtk"):
        files.add(f"gmsh.{ending}", lambda path: gmsh.write(str(path)), wanted)
    gmsh.finalize()


def add_nifti(files):
    """Label maps that nibabel writes, of each type, order of axes, unit and byte order."""
    nibabel = importlib.import_module("nibabel")

    def add(name, place, kind="u1", forms=(1, 1), unit="mm", order="<", cls=nibabel.Nifti1Image, **more):
        def write(path):
            scaled = np.diag([{"mm": 1, "meter": 1e-3, "micron": 1e3}[unit]] * 3 + [1]) @ place
            header = cls.header_class(endianness=order)
            header.set_data_dtype(np.dtype(kind).newbyteorder(order))
            image = cls(MAP.astype(np.dtype(kind).newbyteorder(order)), scaled, header)
            image.header.set_xyzt_units(unit)
            image.set_sform(scaled, forms[0])
            image.set_qform(scaled, forms[1])
            nibabel.save(image, path)
        files.add(name, write, wanted_of_map(place, FROM_RAS), "--nodes 1500", **more)

    def place(turn=np.eye(3), sides=(1, 1, 1), axes=(0, 1, 2)):
        matrix = np.eye(4)
        matrix[:3, :3] = turn @ np.eye(3)[:, axes] * (1.5, 1.4, 2) * sides
        matrix[:3, 3] = -10, 20, 35
        return matrix

    for kind, order in itertools.product(("u1", "i1", "i2", "u2", "i4", "u4", "f4", "f8", "i8"), "<>"):
        add(f"{kind}-{'little' if order == '<' else 'big'}.nii.gz", place(turned(1, 33)), kind, order=order)
    for number, sides in enumerate(itertools.product((1, -1), repeat=3)):
        add(f"sides-{number}.nii", place(sides=sides, axes=[*itertools.permutations(range(3))][number % 6]))
    for axis, forms in itertools.product(range(3), ((1, 1), (0, 1), (2, 0))):
        add(f"oblique-{axis}{forms}.nii.gz", place(turned(axis, 130) @ turned((axis + 1) % 3, -23), (1, 1, -1)),
            forms=forms)
    for unit in ("meter", "micron"):
        add(f"{unit}.nii.gz", place(), unit=unit)
    for order in "<>":
        add(f"second-{'little' if order == '<' else 'big'}.nii.gz", place(), order=order, cls=nibabel.Nifti2Image)


def dicom(kind):
    """A data set without pixels and place."""
    meta = pydicom.dataset.FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = kind, pydicom.uid.generate_uid()
    data = pydicom.dataset.FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID = kind, meta.MediaStorageSOPInstanceUID
    data.StudyInstanceUID, data.SeriesInstanceUID = "1.2.3", "1.2.3.4"
    data.SamplesPerPixel, data.PhotometricInterpretation, data.PixelRepresentation = 1, "MONOCHROME2", 0
    data.Rows, data.Columns = VOXELS[1], VOXELS[0]
    return data


def save(data, path, syntax):
    data.file_meta.TransferSyntaxUID = syntax
    data.is_little_endian = syntax != pydicom.uid.ExplicitVRBigEndian
    data.is_implicit_VR = syntax == pydicom.uid.ImplicitVRLittleEndian
    data.save_as(path, write_like_original=False)


SYNTAXES = {"explicit": pydicom.uid.ExplicitVRLittleEndian, "implicit": pydicom.uid.ImplicitVRLittleEndian,
            "deflated": pydicom.uid.DeflatedExplicitVRLittleEndian, "big": pydicom.uid.ExplicitVRBigEndian}
SPACING, THICKNESS, FIRST = (1.4, 1.5), 2.5, np.array([-20.0, -30.0, 40.0])


def place_of(turn):
    matrix = np.eye(4)
    matrix[:3, :3] = turn * (SPACING[1], SPACING[0], THICKNESS)
    matrix[:3, 3] = FIRST
    return matrix


def add_series(files):
    """Series of label slices that pydicom writes."""
    def add(name, kind="u1", turn=np.eye(3), syntax="explicit", change=lambda data, pixels: None, **more):
        def write(folder):
            folder.mkdir()
            for number in range(VOXELS[2]):
                data, bits = dicom("1.2.840.10008.5.1.4.1.1.2"), 8 * np.dtype(kind).itemsize
                data.ImageOrientationPatient = [*turn[:, 0], *turn[:, 1]]
                data.ImagePositionPatient = [round(c, 6) for c in FIRST + turn[:, 2] * THICKNESS * number]
                data.PixelSpacing, data.SliceThickness = list(SPACING), THICKNESS
                data.BitsAllocated, data.BitsStored, data.HighBit = bits, bits, bits - 1
                data.PixelRepresentation = int(kind[0] == "i")
                pixels = MAP[:, :, number].T.astype((">" if syntax == "big" else "<") + kind)
                data.PixelData = pixels.tobytes()
                change(data, pixels)
                save(data, folder / f"{(7 * number) % VOXELS[2]}", SYNTAXES[syntax])
        files.add(name, write, wanted_of_map(place_of(turn), FROM_LPS), "--nodes 1500", **more)

    def set_values(**values):
        return lambda data, pixels: [setattr(data, name, value) for name, value in values.items()]

    for kind, syntax in itertools.product(("u1", "i1", "u2", "i2"), SYNTAXES):
        add(f"series-{kind}-{syntax}", kind, syntax=syntax)
    for axis in range(3):
        add(f"series-oblique-{axis}", turn=turned(axis, 40) @ turned((axis + 1) % 3, -100))
    add("series-shifted", "u2", change=lambda data, pixels: set_values(
        BitsStored=8, HighBit=15, PixelData=(pixels << 8).tobytes())(data, pixels))
    add("series-rescaled-by-1", change=set_values(RescaleSlope=1, RescaleIntercept=0))
    add("series-slope", change=set_values(RescaleSlope=2), refused="RescaleSlope is 2")
    add("series-intercept", change=set_values(RescaleIntercept=-1024), refused="RescaleIntercept is -1024")
    add("series-wide", "u4", refused="BitsAllocated is 32")


def add_segmentations(files):
    """Segmentations of each kind that pydicom writes."""
    def item(**values):
        data = pydicom.dataset.Dataset()
        for name, value in values.items():
            setattr(data, name, value)
        return data

    def add(name, kind, turn=np.eye(3), syntax="explicit", most=255, keeps_empty=False, **more):
        def write(path):
            is_map = kind == "LABELMAP"
            data = dicom("1.2.840.10008.5.1.4.1.1.66." + ("7" if is_map else "4"))
            data.SegmentationType, data.MaximumFractionalValue = kind, most
            data.SegmentSequence = [item(SegmentNumber=n, SegmentLabel=label) for n, label in
                                    ((1, "label 1"), (2, "label 2"))]
            data.SharedFunctionalGroupsSequence = [item(
                PixelMeasuresSequence=[item(PixelSpacing=list(SPACING), SpacingBetweenSlices=THICKNESS)],
                PlaneOrientationSequence=[item(ImageOrientationPatient=[*turn[:, 0], *turn[:, 1]])])]
            frames, groups = [], []
            for label, number in itertools.product((0,) if is_map else (1, 2), reversed(range(VOXELS[2]))):
                frame = MAP[:, :, number].T if is_map else MAP[:, :, number].T == label
                if not keeps_empty and not frame.any():
                    continue
                group = item(PlanePositionSequence=[item(
                    ImagePositionPatient=[round(c, 6) for c in FIRST + turn[:, 2] * THICKNESS * number])])
                if not is_map:
                    group.SegmentIdentificationSequence = [item(ReferencedSegmentNumber=label)]
                frames.append(frame)
                groups.append(group)
            data.PerFrameFunctionalGroupsSequence, data.NumberOfFrames = groups, len(frames)
            pixels = np.array(frames, "u1")
            bits = 1 if kind == "BINARY" else 8
            data.BitsAllocated, data.BitsStored, data.HighBit = bits, bits, bits - 1
            if kind == "BINARY":
                pixels = np.packbits(pixels.reshape(-1), bitorder="little")
            elif kind == "FRACTIONAL":
                pixels *= most
            data.PixelData = pixels.tobytes() + b"\0" * (pixels.size % 2)
            save(data, path, SYNTAXES[syntax])
        files.add(name, write, wanted_of_map(place_of(turn), FROM_LPS), "--nodes 1500", **more)

    for kind, syntax in itertools.product(("BINARY", "FRACTIONAL", "LABELMAP"), SYNTAXES):
        add(f"{kind}-{syntax}.dcm", kind, syntax=syntax, keeps_empty=syntax == "implicit",
            turn=turned(0, 25) @ turned(2, 60))
    add("hundredths.dcm", "FRACTIONAL", most=100)


def run(program, *arguments):
    """The exit code, and what it says and prints."""
    done = subprocess.run([program, *arguments], text=True, capture_output=True, timeout=60)
    return done.returncode, done.stderr, done.stdout


def fault_of(program, folder, case):
    """Empty, or what comes out otherwise."""
    name, options, wanted, says, refused = case
    organ, mesh = folder / "out.organ", folder / "out.msh"
    ended, said, figures = run(program, "import", folder / name, *options.split(), "--out", organ)
    if ended != (3 if refused else 0) or not re.search(refused or says, said + figures):
        return f"exit code {ended}, must be {3 if refused else 0} and say '{refused or says}': {said.strip()}"
    if refused:
        return ""
    figures = json.loads(run(program, "inspect", organ, "--json")[2])
    run(program, "export", organ, "--out", mesh, "--unit", "mm")
    with contextlib.redirect_stdout(io.StringIO()):
        out = meshio.read(mesh)
    tets = out.get_cells_type("tetra")
    groups = out.get_cell_data("gmsh:physical", "tetra")
    corners = out.points[tets]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6e3
    numbers = np.unique(groups)
    ml = [volumes[groups == number].sum() for number in numbers]
    tolerance = 1e-6 if "tets" in wanted else 0.05
    if len(ml) != len(wanted["ml"]) or not np.allclose(sorted(ml), sorted(wanted["ml"]), rtol=tolerance):
        return f"regions of {ml} ml, must be {wanted['ml']}"
    if "tets" in wanted:
        found = figures["nodes"], figures["tets"], len(tets)
        if found != (wanted["nodes"], wanted["tets"], wanted["tets"]):
            return f"{found} nodes, tets and exported ones, must be {wanted}"
        box = out.points.min(0), out.points.max(0)
        return "" if np.allclose(box, wanted["box"]) else f"from {box[0]} to {box[1]}, must be {wanted['box']}"
    for number, centre in zip(numbers, wanted["centres"]):
        within = groups == number
        found = (corners.mean(1)[within] * volumes[within, None]).sum(0) / volumes[within].sum()
        if np.abs(found - centre).max() > wanted["voxel"]:
            return f"the centre of region {number} is at {found}, must be at {centre}"
    return ""


def main():
    program = pathlib.Path(sys.argv[1]) / "trocar-organ"
    wrong = total = 0
    for add in (add_meshes, add_series, add_segmentations, add_vtk, add_gmsh, add_nifti):
        with tempfile.TemporaryDirectory() as name:
            files = Files(pathlib.Path(name))
            try:
                add(files)
            except ImportError as missing:
                print(f"SKIPPED: {add.__doc__} {missing}", file=sys.stderr)
                continue
            for case in files.cases:
                fault = fault_of(program, files.folder, case)
                wrong += fault != ""
                if fault:
                    print(f"{case[0]}: {fault}")
            total += len(files.cases)
            print(f"{len(files.cases)} files: {add.__doc__}")
    print(f"{total - wrong} of {total} files come out right")
    return 1 if wrong else 0


sys.exit(main())
