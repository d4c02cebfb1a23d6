# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Plans (docs/plan-format.md), as `tissueform plan build` writes them: a mesh with stiffness, regions and poses."""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib
from typing import Any, Dict, List, Mapping, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from ._channel import PathLike
from .client import Client
from .errors import InvalidInput, NotFound, TissueformError
from .meshes import Points, Tets, check_points, check_tets
from .poses import Pose
from .predictions import MaterialRanges
from .sessions import FIXED_BONE, ContactRow, LipEdge, Session

Arrays = Mapping[str, npt.NDArray[Any]]


@dataclasses.dataclass(frozen=True)
class Plan:
    """Made by read_plan. points: (#V, 3) in mm. tets: (#T, 4). stiffness: in Pa, one number or (#T,). fixed, handles: masks, (#V,) bool;
    vertices of contact rows are in none of them. poses: those of the plan, by handle. point_data, cell_data: arrays of the mesh by name.
    lip_edge: what `create_session(seal=True)` holds together, or None. ranges: of the material, for `Session.predict(..., ranges=)`; None
    where the plan states none. coordinate_system: "LPS" or "RAS", of points and poses."""

    points: Points
    tets: Tets
    stiffness: Union[float, npt.NDArray[np.float64]]
    fixed: npt.NDArray[np.bool_]
    handles: Dict[str, npt.NDArray[np.bool_]]
    poses: Dict[str, Pose]
    contact: List[ContactRow]
    model: str
    poisson_ratio: Optional[float]
    coordinate_system: str
    point_data: Arrays
    cell_data: Arrays
    lip_edge: Optional[LipEdge] = None
    ranges: Optional[MaterialRanges] = None

    def create_session(self, client: Client, *, model: Optional[str] = None, seal: bool = False, **options: Any) -> Session:
        """Uploads the mesh and prepares a session of this plan. model: another than the plan's. seal: closed lips stay closed
        (linear_elastic only). options: those of Client.create_session.

        Errors: those of Client.upload_mesh and Client.create_session.
        """
        if seal and self.lip_edge is None:
            raise InvalidInput("the plan has no lips to seal", advice='build it with "lips": {"part": true}, from a CT with closed lips')
        lip_edge = None if self.lip_edge is None else dataclasses.replace(self.lip_edge, sealed=seal)
        mesh = client.upload_mesh(self.points, self.tets, self.stiffness)
        return client.create_session(mesh, handles=self.handles, fixed=self.fixed, model=model or self.model,
                                     poisson_ratio=self.poisson_ratio, contact=self.contact, lip_edge=lip_edge, **options)


def read_plan(path: PathLike) -> Plan:
    """Reads a plan file and its mesh, which is in the plan's folder. Needs meshio, or VTK for a .vtu mesh.

    Errors: NotFound (a file; meshio and VTK), InvalidInput (not a plan, a mesh outside of its folder, a region that the mesh does not have).
    """
    file = pathlib.Path(path)
    plan = _read_json(file)
    try:
        return _plan_of(plan, file)
    except TissueformError:
        raise
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise InvalidInput(f"{file.name} is not a plan: {error!r}", advice="`tissueform plan check` names the place") from error


def _read_json(file: pathlib.Path) -> Any:
    try:
        plan = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise NotFound(f"cannot read the plan {file.name}: {error.strerror}") from error
    except ValueError as error:
        raise InvalidInput(f"{file.name} is not JSON: {error}", advice="give the plan.json that `tissueform plan build` has written") from error
    if not isinstance(plan, dict) or plan.get("format") != "tissueform-plan":
        raise InvalidInput(f"{file.name} is not a plan", advice="give the plan.json that `tissueform plan build` has written")
    return plan


def _plan_of(plan: Any, file: pathlib.Path) -> Plan:
    points, tets, point_data, cell_data = _read_mesh(_mesh_file(file, plan["mesh"]))
    contact = [_contact_row(row) for row in plan.get("contact", {}).get("rows", [])]
    free = np.zeros(len(points), dtype=bool)
    free[[row.vertex for row in contact]] = True
    handles = {handle["name"]: _selected(handle["region"], points, point_data) & ~free for handle in plan["handles"]}
    return Plan(points=points, tets=tets, stiffness=_stiffness(plan["stiffness"], cell_data),
                fixed=_selected(plan["fixed"], points, point_data) & ~free, handles=handles,
                poses={handle["name"]: _pose(handle.get("pose", {})) for handle in plan["handles"]}, contact=contact,
                lip_edge=_lip_edge(plan.get("contact", {}).get("seal")), ranges=_ranges(plan, cell_data, len(tets)),
                model=plan.get("model", "gradient_field"), poisson_ratio=plan.get("poisson_ratio"),
                coordinate_system=plan["coordinate_system"], point_data=point_data, cell_data=cell_data)


def _mesh_file(plan: pathlib.Path, name: str) -> pathlib.Path:
    folder = plan.resolve().parent
    mesh = (folder / name).resolve()
    if folder not in mesh.parents:
        raise InvalidInput(f"the plan's mesh {name} is outside of the plan's folder", advice="copy it next to the plan")
    if not mesh.is_file():
        raise NotFound(f"there is no mesh {name} next to the plan")
    return mesh


def _read_mesh(file: pathlib.Path) -> Tuple[Points, Tets, Arrays, Arrays]:
    try:
        points, tets, point_data, cell_data = _read_with_meshio(file)
    except ImportError:
        points, tets, point_data, cell_data = _read_with_vtk(file)
    checked = check_points(points, any_size=True)
    return checked, check_tets(tets, checked), point_data, cell_data


def _read_with_meshio(file: pathlib.Path) -> Tuple[Any, Any, Arrays, Arrays]:
    import meshio

    try:
        mesh = meshio.read(file)
    except (meshio.ReadError, SystemExit) as error:
        raise InvalidInput(f"cannot read the mesh {file.name}", advice="convert it to .vtu with linear tets") from error
    tetra = [index for index, cells in enumerate(mesh.cells) if cells.type == "tetra"]
    if not tetra:
        raise InvalidInput(f"the mesh {file.name} has no linear tets")
    cell_data = {name: np.concatenate([np.asarray(blocks[index]) for index in tetra]) for name, blocks in mesh.cell_data.items()}
    return mesh.points, np.concatenate([mesh.cells[index].data for index in tetra]), dict(mesh.point_data), cell_data


def _read_with_vtk(file: pathlib.Path) -> Tuple[Any, Any, Arrays, Arrays]:
    try:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader
    except ImportError as error:
        raise NotFound("neither meshio nor VTK is installed", advice="pip install 'tissueform[meshio]'") from error
    reader = vtkXMLUnstructuredGridReader()
    if file.suffix != ".vtu" or not reader.CanReadFile(str(file)):
        raise InvalidInput(f"VTK cannot read the mesh {file.name}", advice="convert it to .vtu, or install meshio")
    reader.SetFileName(str(file))
    reader.Update()
    grid = reader.GetOutput()
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
    if grid.GetNumberOfCells() == 0 or grid.GetCellTypesArray() is None or not (vtk_to_numpy(grid.GetCellTypesArray()) == 10).all():
        raise InvalidInput(f"the mesh {file.name} has other cells than linear tets")

    def arrays(data: Any) -> Arrays:
        return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays()) if data.GetArray(i) is not None}
    return vtk_to_numpy(grid.GetPoints().GetData()), cells.reshape(-1, 4), arrays(grid.GetPointData()), arrays(grid.GetCellData())


def _array(arrays: Arrays, name: str) -> npt.NDArray[Any]:
    if name not in arrays:
        raise InvalidInput(f'the mesh has no array "{name}"; it has {", ".join(arrays) or "no arrays"}')
    return arrays[name]


def _selected(selector: Any, points: Points, point_data: Arrays) -> npt.NDArray[np.bool_]:
    if "union" in selector:
        parts = [_selected(part, points, point_data) for part in selector["union"]]
        return np.logical_or.reduce(parts)  # type: ignore[no-any-return]
    if "point_data" in selector:
        return np.asarray(_array(point_data, selector["point_data"]) == selector["equals"])
    if "box_mm" in selector:
        box = selector["box_mm"]
        return np.asarray(((points >= box["min"]) & (points <= box["max"])).all(axis=1))
    mask = np.zeros(len(points), dtype=bool)
    try:
        mask[np.asarray(selector["vertices"], dtype=np.int64)] = True
    except IndexError as error:
        raise InvalidInput(f"a region has a vertex that the mesh does not have: {error}") from error
    return mask


def _stiffness(stiffness: Any, cell_data: Arrays) -> Union[float, npt.NDArray[np.float64]]:
    if "uniform" in stiffness:
        return float(stiffness["uniform"])
    if "cell_data" in stiffness:
        return _array(cell_data, stiffness["cell_data"]).astype(np.float64)
    labels = _array(cell_data, stiffness["by_cell_data"])
    result = np.full(len(labels), np.nan)
    for label, pascal in stiffness["values"].items():
        result[labels == float(label)] = pascal
    if np.isnan(result).any():
        raise InvalidInput(f'the plan states no stiffness for a label of "{stiffness["by_cell_data"]}"')
    return result


def _ranges(plan: Any, cell_data: Arrays, tet_count: int) -> Optional[MaterialRanges]:
    if "uncertainty" not in plan:
        return None
    uncertainty = plan["uncertainty"]
    factor = uncertainty.get("youngs_modulus_factor_95", 1)
    labels = _tissues(factor, plan["stiffness"], cell_data, tet_count)
    values, tissues = np.unique(labels, return_inverse=True)
    by_label = {float(label): float(number) for label, number in factor["values"].items()} if isinstance(factor, dict) else {}
    missing = [value for value in values if isinstance(factor, dict) and float(value) not in by_label]
    if missing:
        raise InvalidInput(f'the plan states no range for the label {missing[0]:g} of "{factor["by_cell_data"]}"')
    factors = [by_label[float(value)] if by_label else float(factor) for value in values]
    ranges = MaterialRanges(tissues=tissues, factors_95=factors)
    if "poisson_ratio_95" not in uncertainty:
        return ranges
    lowest, highest = uncertainty["poisson_ratio_95"]
    return dataclasses.replace(ranges, poisson_ratio=(lowest, highest))


def _tissues(factor: Any, stiffness: Any, cell_data: Arrays, tet_count: int) -> npt.NDArray[Any]:
    """The array that distinguishes tissues, as docs/plan-format.md states ("Ranges of the material")."""
    for name in (factor["by_cell_data"] if isinstance(factor, dict) else None, stiffness.get("by_cell_data")):
        if name is not None:
            return _array(cell_data, name)
    if "tissue" in cell_data:
        return cell_data["tissue"]
    return _array(cell_data, stiffness["cell_data"]) if "cell_data" in stiffness else np.zeros(tet_count)


def _pose(pose: Any) -> Pose:
    zero = (0.0, 0.0, 0.0)
    turn = [math.radians(angle) for angle in pose.get("rotation_vector_deg", zero)]
    return Pose(tuple(pose.get("translation_mm", zero)), tuple(turn), tuple(pose.get("pivot_mm", zero)), pose.get("scale", 1.0))


def _lip_edge(seal: Any) -> Optional[LipEdge]:
    return None if seal is None else LipEdge(tuple(seal["up"]), [(int(upper), int(lower)) for upper, lower in seal["pairs"]], sealed=False)


def _contact_row(row: Any) -> ContactRow:
    touches = row["handle"] if "handle" in row else FIXED_BONE if "fixed" in row else int(row["other_vertex"])
    return ContactRow(row["vertex"], touches, row["normal"], row.get("gap_mm", 0.0), row.get("bilateral", False))
