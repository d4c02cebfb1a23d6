#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The comparison of answers sees the last bit, and does not see what is of the run."""

import pathlib
import sys
import tempfile
import unittest

try:
    import numpy
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkStringArray
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

    import compare_answers
except ImportError as missing:
    print(f"skipped: {missing}; install python3-vtk9")
    sys.exit(77)

BAR = compare_answers.ROOT / "tests/data/plans/bar/bar.vtu"


class MeshesTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(BAR))
        reader.Update()
        self.grid = reader.GetOutput()

    def differences(self):
        path = pathlib.Path(self.folder.name) / "changed.vtu"
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetInputData(self.grid)
        writer.SetFileName(str(path))
        writer.SetDataModeToBinary()  # the bundled file is appended
        writer.Write()
        return list(compare_answers.differences_of_meshes(BAR, path))

    def test_the_encoding_of_a_file_is_no_difference(self):
        self.assertEqual(self.differences(), [])

    def test_a_notice_is_no_difference(self):
        notice = vtkStringArray()
        notice.SetName("notice")
        notice.InsertNextValue("for research")
        self.grid.GetFieldData().AddArray(notice)
        self.assertEqual(self.differences(), [])

    def test_the_last_bit_of_one_number_is_a_difference(self):
        points = vtk_to_numpy(self.grid.GetPoints().GetData())
        points[3, 1] = numpy.nextafter(points[3, 1], points[3, 1] + 1)
        (difference,) = self.differences()
        self.assertIn("points differs in 1 numbers", difference)

    def test_an_array_too_many_or_too_few_is_a_difference(self):
        more = numpy_to_vtk(numpy.zeros(self.grid.GetNumberOfPoints()), deep=True)
        more.SetName("more")
        self.grid.GetPointData().AddArray(more)
        self.grid.GetPointData().RemoveArray("anatomy")
        self.assertEqual(self.differences(), ["point array anatomy is only before", "point array more is only now"])


class JsonTest(unittest.TestCase):
    def differences(self, old, new):
        return list(compare_answers.differences_of_json(old, new))

    def test_times_and_new_keys_are_no_difference(self):
        before, now = {"solves": 3, "deform_seconds": 1.5}, {"solves": 3, "deform_seconds": 2.5, "new": 1}
        self.assertEqual(self.differences(before, now), [])

    def test_a_number_far_down_is_a_difference(self):
        (difference,) = self.differences({"a": [{"b": 0.1}]}, {"a": [{"b": 0.1 + 2e-17}]})
        self.assertTrue(difference.startswith("/a/0/b was 0.1, is 0.1000"))

    def test_a_lost_key_and_another_type_are_differences(self):
        self.assertEqual(len(self.differences({"a": 1, "b": 1}, {"b": 1.0})), 2)


class ScenesTest(unittest.TestCase):
    def scene(self, name, numbers, text=b'{"a": 1}'):
        path = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory())) / name
        chunks = b"".join(len(data).to_bytes(4, "little") + kind + data for kind, data in ((b"JSON", text), (b"BIN\0", numbers)))
        path.write_bytes(b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks)
        return path

    def test_a_changed_byte_or_text_is_a_difference(self):
        before = self.scene("a.glb", b"1234")
        self.assertEqual(list(compare_answers.differences_of_files(before, self.scene("b.glb", b"1234"))), [])
        self.assertEqual(len(list(compare_answers.differences_of_files(before, self.scene("b.glb", b"1235")))), 1)
        self.assertEqual(len(list(compare_answers.differences_of_files(before, self.scene("b.glb", b"1234", b'{"a": 2}')))), 1)

    def test_another_file_is_named(self):
        path = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory())) / "a.glb"
        path.write_bytes(b"solid a")
        with self.assertRaises(compare_answers.Failure):
            compare_answers.chunks_of(path)


if __name__ == "__main__":
    unittest.main()
