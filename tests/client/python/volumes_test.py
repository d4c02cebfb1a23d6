# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Volumes go to a server as geometry and values; text that may name a patient stays here."""

import gzip
import pathlib
import struct
import tempfile
import unittest
import zlib

import numpy as np
from tissueform import InvalidInput, NotFound, Volume
from tissueform.plan_builds import _recipe_files
from tissueform.volumes import file_of

NRRD = (b"NRRD0005\n# Planted\ncontent: Planted\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 2 2 2\n"
        b"space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (1,2,3)\nencoding: raw\nDICOM_patientID:=Planted\n"
        b"Segment0_Name:=mandible\n\n")
META_IMAGE = (b"ObjectType = Image\nNDims = 3\nComment = Planted\nDimSize = 2 2 2\nPatient = Planted\nElementType = MET_UCHAR\n"
              b"ElementDataFile = LOCAL\n")
VOXELS = bytes(range(16))


def nifti():
    header = bytearray(512)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<f", header, 108, 512)
    for at in (4, 14, 148, 228, 328, 360):
        header[at:at + 7] = b"Planted"
    table = b'Planted<Label Key="3">Planted<Label Key="1" Red="0"><![CDATA[mandible]]></Label>Planted<Label Key="2">Planted'
    header[370:370 + len(table)] = table
    return bytes(header) + VOXELS


class VolumeTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_arrays_become_a_file_with_their_geometry(self):
        values = np.arange(24, dtype=np.float32).reshape(2, 3, 4) - 1000.4
        affine = np.array([[0, -0.5, 0, 10], [2, 0, 0, 20], [0, 0, 3, 30], [0, 0, 0, 1]])
        for system, sign in (("LPS", 1), ("RAS", -1)):
            suffix, data = Volume(values, affine, system).to_file("CT")
            header, _, packed = data.partition(b"ElementDataFile = LOCAL\n")
            fields = dict(line.split(" = ") for line in header.decode().splitlines())
            self.assertEqual(suffix, ".mha")
            self.assertEqual(fields["DimSize"], "2 3 4")
            np.testing.assert_array_equal(np.fromstring(fields["ElementSpacing"], sep=" "), [2, 0.5, 3])
            np.testing.assert_array_equal(np.fromstring(fields["Offset"], sep=" "), [10 * sign, 20 * sign, 30])
            np.testing.assert_array_equal(np.fromstring(fields["TransformMatrix"], sep=" "), [0, sign, 0, -sign, 0, 0, 0, 0, 1])
            stored = np.frombuffer(zlib.decompress(packed), "<i2").reshape((2, 3, 4), order="F")
            np.testing.assert_array_equal(stored, np.rint(values))

    def test_text_of_files_is_not_sent(self):
        for name, data in (("a.seg.nrrd", NRRD + VOXELS), ("a.mha", META_IMAGE + VOXELS), ("a.nii", nifti()), ("a.nii.gz", gzip.compress(nifti()))):
            with self.subTest(name):
                file = self.folder / name
                file.write_bytes(data)
                suffix, sent = file_of(file, "label map")
                sent = gzip.decompress(sent) if suffix == ".nii.gz" else sent
                self.assertNotIn(b"Planted", sent)
                self.assertTrue(sent.endswith(VOXELS))
                self.assertEqual(b"mandible" in sent, name != "a.mha")

    def refused(self, message, advice, volume, kind=InvalidInput):
        with self.assertRaises(kind) as caught:
            file_of(volume, "CT")
        self.assertRegex(caught.exception.message, message)
        self.assertRegex(caught.exception.advice, advice)

    def test_bad_volumes_are_refused_by_one_line(self):
        values, affine = np.zeros((2, 2, 2)), np.eye(4)
        self.refused(r"shape \(2, 2\)", "correct", Volume(values[0], affine))
        self.refused("shape", "correct", Volume(np.full((2, 2, 2), np.nan), affine))
        self.refused("array of numbers", "correct", Volume([[1], [1, 2]], affine))
        self.refused("values from 0 to 40000", "correct", Volume(values + np.arange(2) * 40000, affine))
        self.refused("last row", "correct", Volume(values, np.eye(3)))
        self.refused("flat voxels", "correct", Volume(values, np.diag([1.0, 1, 0, 1])))
        self.refused('is "LAS"', "RAS", Volume(values, affine, "LAS"))
        self.refused("is a folder", "from_dicom", self.folder)
        self.refused("cannot read", "check the name", self.folder / "none.nrrd", NotFound)
        for name, data, message in (("a.dcm", b"x", "is not a .nrrd"), ("a.nrrd", b"NRRD0005\ndata file: b\n\n", "a file of their own"),
                                    ("b.nrrd", b"x", "damaged"), ("a.mha", b"x", "damaged"), ("a.nii", b"x" * 400, "damaged"),
                                    ("a.nii.gz", b"\x1f\x8bx", "damaged")):
            (self.folder / name).write_bytes(data)
            self.refused(message, ".", self.folder / name)

    def test_files_that_a_recipe_names_are_found(self):
        (self.folder / "jaw.stl").write_bytes(b"solid")
        recipe = {"labels": {"file": "labels.nrrd"}, "landmarks": {"file": "l.mrk.json"},
                  "segments": [{"surface": {"file": "jaw.stl"}, "name": "file"}]}
        sent = _recipe_files(recipe, {"l.mrk.json": b"{}"}, self.folder)
        self.assertEqual({name: payload.header.suffix for name, payload in sent.items()}, {"jaw.stl": ".stl", "l.mrk.json": ".json"})
        with self.assertRaises(NotFound):
            _recipe_files(recipe, {}, None)
        with self.assertRaises(InvalidInput):
            _recipe_files({"transform": "move.txt"}, {}, self.folder)


if __name__ == "__main__":
    unittest.main()
