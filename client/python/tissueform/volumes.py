# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Volumes for building plans: of numpy arrays, or files without the text in them that may name a patient."""

from __future__ import annotations

import dataclasses
import gzip
import pathlib
import re
import struct
import zlib
from typing import Any, Iterable, Tuple, Union

import numpy as np
import numpy.typing as npt

from ._channel import PathLike
from .errors import InvalidInput, NotFound

_MAX_HEADER_BYTES = 1 << 20
_RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0])
_TYPES = {"int16": "MET_SHORT", "uint8": "MET_UCHAR", "uint16": "MET_USHORT"}
# What places and decodes the voxels. Everything else of a header is not sent (core/imaging/labels/bare_label_map.cc).
_NRRD_FIELDS = frozenset(("type", "dimension", "space", "space dimension", "sizes", "kinds", "space directions", "space origin", "space units",
                          "measurement frame", "endian", "encoding", "spacings", "centers", "centerings", "byte skip", "line skip"))
_SEGMENT_KEY = re.compile(r"Segment\d+_(Name|LabelValue|Layer|Tags)")
_META_KEYS = frozenset(("ObjectType", "NDims", "BinaryData", "BinaryDataByteOrderMSB", "ElementByteOrderMSB", "CompressedData",
                        "CompressedDataSize", "TransformMatrix", "Rotation", "Orientation", "Offset", "Position", "Origin",
                        "AnatomicalOrientation", "ElementSpacing", "ElementSize", "DimSize", "ElementNumberOfChannels", "ElementType",
                        "ElementDataFile"))
_NIFTI_HEADER_BYTES = 348
_NIFTI_TEXTS = ((4, 10), (14, 18), (148, 80), (228, 24), (328, 16))  # data_type, db_name, descrip, aux_file, intent_name
_NIFTI_LABEL = re.compile(rb"<Label [^<]*(?:<!\[CDATA\[.*?\]\]>)?[^<]*</Label>", re.DOTALL)
_ONE_FILE = "store it as one .nrrd, .nii.gz or .mha"


@dataclasses.dataclass(frozen=True)
class Volume:
    """values: (I, J, K) numbers: Hounsfield units of a CT (-32768 to 32767), or whole numbers from 0 of a label map. affine: (4, 4), from
    voxel indices (i, j, k, 1) to mm; its axes may have any direction. coordinate_system: "LPS" (DICOM, ITK), or "RAS" (nibabel, 3D Slicer):

        image = nibabel.load("head.nii.gz")
        volume = tissueform.Volume(image.get_fdata(), image.affine, "RAS")  # as tissueform.from_nibabel(image)
        volume = tissueform.from_dicom("CT/")
    """

    values: npt.ArrayLike
    affine: npt.ArrayLike
    coordinate_system: str = "LPS"

    def to_file(self, what: str) -> Tuple[str, bytes]:
        """Suffix and bytes of a MetaImage: geometry and values. Errors: InvalidInput; `what` names the volume in messages."""
        values, affine = _checked_values(self.values, what), _checked_affine(self.affine, what)
        steps, origin = affine[:3, :3], affine[:3, 3]
        if self.coordinate_system == "RAS":
            steps, origin = _RAS_TO_LPS @ steps, _RAS_TO_LPS @ origin
        elif self.coordinate_system != "LPS":
            raise InvalidInput(f'the coordinate system of the {what} is "{self.coordinate_system}"', advice='give "LPS" or "RAS"')
        spacing = np.linalg.norm(steps, axis=0)
        packed = zlib.compress(values.tobytes(order="F"), 1)
        header = ["ObjectType = Image", "NDims = 3", "BinaryData = True", "BinaryDataByteOrderMSB = False", "CompressedData = True",
                  f"CompressedDataSize = {len(packed)}", f"TransformMatrix = {_numbers((steps / spacing).ravel(order='F'))}",
                  f"Offset = {_numbers(origin)}", "AnatomicalOrientation = RAI", f"ElementSpacing = {_numbers(spacing)}",
                  f"DimSize = {' '.join(map(str, values.shape))}", f"ElementType = {_TYPES[values.dtype.name]}", "ElementDataFile = LOCAL"]
        return ".mha", ("\n".join(header) + "\n").encode() + packed


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _checked_values(values: npt.ArrayLike, what: str) -> npt.NDArray[Any]:
    try:
        array = np.asarray(values)
        bad = array.ndim != 3 or array.size == 0 or array.dtype.kind not in "biuf" or not np.isfinite(array).all()
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"the {what} cannot be made an array of numbers: {error}") from error
    if bad:
        raise InvalidInput(f"the {what} has the shape {array.shape} and the type {array.dtype}: expected (I, J, K), finite numbers")
    if array.dtype.name in _TYPES:
        return array
    rounded = np.rint(array)
    if rounded.min() < -32768 or rounded.max() > 32767:
        raise InvalidInput(f"the {what} has values from {array.min():g} to {array.max():g}: expected -32768 to 32767")
    return np.asarray(rounded, dtype=np.int16)


def _checked_affine(affine: npt.ArrayLike, what: str) -> npt.NDArray[np.float64]:
    matrix = np.asarray(affine, dtype=np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or matrix[3].tolist() != [0, 0, 0, 1]:
        raise InvalidInput(f"the affine of the {what} is not a (4, 4) matrix with the last row 0 0 0 1")
    if abs(np.linalg.det(matrix[:3, :3])) < 1e-9:
        raise InvalidInput(f"the affine of the {what} has flat voxels")
    return matrix


def _damaged(what: str) -> InvalidInput:
    return InvalidInput(f"the {what} is cut off, damaged, or not of its ending's format")


def _bare_nrrd(file: bytes, what: str) -> bytes:
    end = re.search(rb"\r?\n\r?\n", file[:_MAX_HEADER_BYTES])
    if end is None or not file.startswith(b"NRRD"):
        raise _damaged(what)
    first, *lines = file[:end.start()].decode("latin-1").splitlines()
    kept = [first]
    for line in lines:
        field, colon, rest = line.partition(":")
        if field.lower() in ("data file", "datafile"):
            raise InvalidInput(f"the voxels of the {what} are in a file of their own", advice=_ONE_FILE)
        is_key = rest.startswith("=")
        if _SEGMENT_KEY.fullmatch(field) if is_key else field.lower() in _NRRD_FIELDS:
            kept.append(line)
    return ("\n".join(kept) + "\n\n").encode("latin-1") + file[end.end():]


def _bare_meta_image(file: bytes, what: str) -> bytes:
    kept, at = b"", 0
    while at < _MAX_HEADER_BYTES:
        end = file.find(b"\n", at) + 1
        if end == 0:
            break
        key, _, value = (part.strip() for part in file[at:end].decode("latin-1").partition("="))
        if key in _META_KEYS:
            kept += file[at:end]
        at = end
        if key == "ElementDataFile":
            if value != "LOCAL":
                raise InvalidInput(f"the voxels of the {what} are in a file of their own", advice=_ONE_FILE)
            return kept + file[at:]
    raise _damaged(what)


def _bare_nifti(file: bytes, what: str) -> bytes:
    try:
        data = bytearray(gzip.decompress(file) if file.startswith(b"\x1f\x8b") else file)
        order = "<" if struct.unpack_from("<i", data)[0] == _NIFTI_HEADER_BYTES else ">"
        offset = int(struct.unpack_from(order + "f", data, 108)[0])
        if struct.unpack_from(order + "i", data)[0] != _NIFTI_HEADER_BYTES or not _NIFTI_HEADER_BYTES + 4 <= offset <= len(data):
            raise _damaged(what)
    except (OSError, EOFError, zlib.error, struct.error, ValueError, OverflowError) as error:
        raise _damaged(what) from error
    extensions = bytes(data[_NIFTI_HEADER_BYTES:offset])
    for begin, count in (*_NIFTI_TEXTS, (_NIFTI_HEADER_BYTES, len(extensions))):
        data[begin:begin + count] = bytes(count)
    for label in _NIFTI_LABEL.finditer(extensions):  # of them only the names of labels, where they are
        data[_NIFTI_HEADER_BYTES + label.start():_NIFTI_HEADER_BYTES + label.end()] = label[0]
    return gzip.compress(bytes(data), 1, mtime=0)


def file_of(volume: Union[Volume, PathLike], what: str) -> Tuple[str, bytes]:
    """Suffix and bytes of a volume for the server, without the text in a file's header. Errors: InvalidInput, NotFound."""
    if isinstance(volume, Volume):
        return volume.to_file(what)
    path = pathlib.Path(volume)
    if path.is_dir():
        raise InvalidInput(f"the {what} is a folder", advice="read a DICOM series with tissueform.from_dicom(folder), which needs pydicom")
    try:
        file = path.read_bytes()
    except OSError as error:
        raise NotFound(f"cannot read the {what}: {error.strerror}") from error
    name = path.name.lower()
    if name.endswith(".nrrd"):
        return ".nrrd", _bare_nrrd(file, what)
    if name.endswith(".mha"):
        return ".mha", _bare_meta_image(file, what)
    if name.endswith((".nii", ".nii.gz")):
        return ".nii.gz", _bare_nifti(file, what)
    raise InvalidInput(f"the {what} is not a .nrrd, .nii, .nii.gz or .mha file", advice="convert it, or read it with a library and give a Volume")
