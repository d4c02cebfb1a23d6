# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""CT series of DICOM files by pydicom, which is optional: pip install 'tissueform[pydicom]'. Of the files only pixels and geometry are kept."""

from __future__ import annotations

import os
import pathlib
import warnings
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from ._channel import PathLike
from .errors import InvalidInput, NotFound
from .volumes import Volume

_MAX_FILES = 20_000
_LEAST_SLICES = 3
_TAGS = ("Modality", "SeriesInstanceUID", "Rows", "Columns", "NumberOfFrames", "SamplesPerPixel", "ImagePositionPatient",
         "ImageOrientationPatient", "PixelSpacing")
# As files write them: in text of 16 characters.
_SAME_MM = 0.01
_SAME_DIRECTION = 1e-4
_STEPS_DIFFER = 0.02  # of a step
_BY_COMMAND = "`tissueform plan build --server HOST:PORT --ct FOLDER` reads more kinds of DICOM"


def from_dicom(files: Union[PathLike, Iterable[PathLike]], series: Optional[int] = None) -> Volume:
    """The Volume of a CT series, for build_plan: Hounsfield units, LPS.

    files: a folder with its folders, or paths of files; what is no DICOM and no CT image is passed over. series: which one where there
    are several, by its place from 0, the one of most slices first.

    Errors: NotFound (no pydicom, no CT image), InvalidInput (several series and none chosen, at most 20,000 files, slices of different
    geometry, unequal steps between slices or a missing one, several scans in one series, a tilted gantry, frames of one file, a
    compression that this pydicom does not decode). No message names a patient or a UID.
    """
    found = list(_series_in(_paths(files)).values())
    if not found:
        raise NotFound("there is no CT image of DICOM in the files", advice="give the folder of the CT's series")
    found.sort(key=len, reverse=True)
    if series is None and len(found) > 1:
        sizes = ", ".join(f"{place} has {len(images)}" for place, images in enumerate(found))
        raise InvalidInput(f"there are {len(found)} series of CT images: {sizes} slices", advice="choose one with series=")
    chosen = series or 0
    if not 0 <= chosen < len(found):
        raise InvalidInput(f"there is no series {chosen}", advice=f"give series= 0 to {len(found) - 1}")
    return _volume_of([_geometry_of(image) for image in found[chosen]])


def _paths(files: Union[PathLike, Iterable[PathLike]]) -> List[pathlib.Path]:
    if isinstance(files, (str, os.PathLike)):
        folder = pathlib.Path(files)
        if not folder.exists():
            raise NotFound("there is no such file or folder", advice="check the path of the CT")
        paths = sorted(path for path in folder.rglob("*") if path.is_file()) if folder.is_dir() else [folder]
    else:
        paths = [pathlib.Path(file) for file in files]
    if len(paths) > _MAX_FILES:
        raise InvalidInput(f"there are {len(paths)} files: at most {_MAX_FILES} are read", advice="give the folder of the CT's series")
    return paths


def _series_in(paths: Iterable[pathlib.Path]) -> Dict[str, List[Any]]:
    try:
        import pydicom
        from pydicom.errors import InvalidDicomError
    except ImportError as error:
        raise NotFound("pydicom is not installed", advice="pip install pydicom") from error
    series: Dict[str, List[Any]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pydicom's quote what stands in the file
        for path in paths:
            try:
                image = pydicom.dcmread(path, stop_before_pixels=True, specific_tags=list(_TAGS))
            except (InvalidDicomError, EOFError, OSError, ValueError, KeyError):
                continue
            if image.get("Modality") == "CT" and "Rows" in image:
                series.setdefault(str(image.get("SeriesInstanceUID", "")), []).append(_Image(path, image))
    return series


class _Image(NamedTuple):
    """A file, and of its header what is needed."""

    path: pathlib.Path
    header: Any


class _Slice(NamedTuple):
    """A file and its size, its corner, its (3, 2) directions of columns and rows, and its (2,) spacing along them, mm."""

    path: pathlib.Path
    size: Tuple[int, int]
    corner: npt.NDArray[np.float64]
    axes: npt.NDArray[np.float64]
    spacing: npt.NDArray[np.float64]


def _geometry_of(file: _Image) -> _Slice:
    image = file.header
    if int(image.get("NumberOfFrames", 1) or 1) > 1:
        raise InvalidInput("a file of the CT holds several frames", advice=_BY_COMMAND)
    if int(image.get("SamplesPerPixel", 1)) != 1:
        raise InvalidInput("an image of the CT is colored: it is a picture, not a slice", advice="choose another series with series=")
    try:
        corner = np.array(image.ImagePositionPatient, dtype=np.float64)
        axes = np.array(image.ImageOrientationPatient, dtype=np.float64).reshape(2, 3).T
        spacing = np.array(image.PixelSpacing, dtype=np.float64)[::-1]
    except (AttributeError, TypeError, ValueError) as error:
        raise InvalidInput("a slice of the CT has no position, orientation or pixel spacing", advice=_BY_COMMAND) from error
    if corner.shape != (3,) or spacing.shape != (2,) or not (spacing > 0).all() or not np.isfinite(corner).all():
        raise InvalidInput("a slice of the CT has a damaged position or pixel spacing", advice=_BY_COMMAND)
    if np.abs(axes.T @ axes - np.eye(2)).max() > _SAME_DIRECTION:
        raise InvalidInput("the axes of a slice of the CT are not at right angles", advice=_BY_COMMAND)
    return _Slice(file.path, (image.Rows, image.Columns), corner, axes, spacing)


def _volume_of(slices: List[_Slice]) -> Volume:
    if len(slices) < _LEAST_SLICES:
        raise InvalidInput(f"the series has {len(slices)} slices: at least {_LEAST_SLICES} make a volume", advice="choose another series with series=")
    slices, step = _in_order(slices)
    first = slices[0]
    affine = np.eye(4)
    affine[:3, :2] = first.axes * first.spacing
    affine[:3, 2], affine[:3, 3] = step, first.corner
    return Volume(np.stack([_hounsfield_units(part.path) for part in slices], axis=2), affine, "LPS")


def _in_order(slices: List[_Slice]) -> Tuple[List[_Slice], npt.NDArray[np.float64]]:
    """Along the normal, and the way from each to the next."""
    first = slices[0]
    for other in slices[1:]:
        is_alike = (np.abs(other.axes - first.axes).max() <= _SAME_DIRECTION and np.abs(other.spacing - first.spacing).max() <= _SAME_MM
                    and other.size == first.size)
        if not is_alike:
            raise InvalidInput("slices of the series differ in size, direction or pixel spacing", advice="choose another series with series=")
    normal = np.cross(first.axes[:, 0], first.axes[:, 1])
    slices = sorted(slices, key=lambda part: float(normal @ part.corner))
    way = slices[-1].corner - slices[0].corner
    step = way / (len(slices) - 1)
    heights = np.array([normal @ part.corner for part in slices])
    steps = np.diff(heights)
    if steps.min() < _SAME_MM:
        raise InvalidInput("two slices of the series lie in one place: it holds several scans", advice=_BY_COMMAND)
    if steps.max() - steps.min() > _STEPS_DIFFER * np.median(steps) + _SAME_MM:
        raise InvalidInput(f"the steps between slices are {steps.min():.2f} to {steps.max():.2f} mm: slices are missing, or of different thickness",
                           advice="give all files of the series")
    if np.linalg.norm(way - (normal @ way) * normal) > _SAME_MM * len(slices):
        raise InvalidInput("the slices are sheared: the gantry was tilted", advice=_BY_COMMAND)
    return slices, step


def _hounsfield_units(path: pathlib.Path) -> npt.NDArray[np.int16]:
    """(columns, rows)"""
    import pydicom

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = pydicom.dcmread(path)
            stored = image.pixel_array
    except Exception as error:  # pydicom and its decoders raise what they like
        raise InvalidInput("a slice of the CT cannot be decoded: it is damaged, or compressed in a way that this pydicom does not know",
                           advice=_BY_COMMAND) from error
    values = stored * float(image.get("RescaleSlope", 1)) + float(image.get("RescaleIntercept", 0))
    return np.asarray(np.clip(np.rint(values), -32768, 32767), dtype=np.int16).T
