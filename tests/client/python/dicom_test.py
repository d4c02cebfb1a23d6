# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""CT series become volumes with the voxels where the files say, and nothing else of the files."""

import pathlib
import random
import sys
import tempfile
import unittest
import warnings

import nibabel
import numpy as np
import pydicom
import tissueform
from plan_builds_test import head
from programs import SOURCE
from tissueform import InvalidInput, NotFound, from_dicom

sys.path.insert(0, str(SOURCE / "deploy/pacs"))
from head_series import SHAPE, write_series  # noqa: E402  (the path first)


def places(volume, indices):
    """Where voxels are, LPS, mm."""
    sign = [-1, -1, 1] if volume.coordinate_system == "RAS" else [1, 1, 1]
    affine = np.asarray(volume.affine)
    return (indices @ affine[:3, :3].T + affine[:3, 3]) * sign


class DicomTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def series(self, name="CT", **options):
        write_series(self.folder / name, **options)
        return self.folder / name

    def refused(self, text, files, error=InvalidInput, **options):
        with self.assertRaisesRegex(error, text) as caught:
            from_dicom(files, **options)
        self.assertNotRegex(str(caught.exception), r"Demo|DEMO|2\.25\.")
        self.assertNotIn("\n", str(caught.exception))

    def test_each_voxel_is_where_its_file_says(self):
        files = list(self.series().iterdir())
        random.Random(3).shuffle(files)
        (self.folder / "CT/notes.txt").write_text("no DICOM")
        volume = from_dicom(files)
        self.assertEqual(volume.coordinate_system, "LPS")
        indices = np.random.default_rng(3).integers(0, volume.values.shape, (200, 3))
        found = {tuple(np.round(place, 3)): volume.values[tuple(index)] for place, index in zip(places(volume, indices), indices)}
        for file in files:
            image = pydicom.dcmread(file)
            right, down = np.array(image.ImageOrientationPatient[:3]), np.array(image.ImageOrientationPatient[3:])
            for row, column in np.ndindex(*SHAPE[1:]):
                at = np.array(image.ImagePositionPatient) + column * image.PixelSpacing[1] * right + row * image.PixelSpacing[0] * down
                value = found.pop(tuple(np.round(at, 3)), None)
                if value is not None:
                    self.assertEqual(value, image.pixel_array[row, column] - 1024)
        self.assertFalse(found)

    def test_it_is_the_head_of_the_other_readers(self):
        volume, other = from_dicom(self.series()), head()
        corner = np.array([[0, 0, 0], [63, 0, 0], [0, 63, 0], [0, 0, 92]])
        shift = places(volume, corner) - places(other, corner)
        np.testing.assert_allclose(shift, np.tile(shift[0], (4, 1)), atol=1e-9)
        np.testing.assert_array_equal(volume.values, other.values)

    def test_images_of_nibabel_are_where_nibabel_has_them(self):
        values = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
        affine = np.array([[0, -0.5, 0, 10], [2, 0, 0, 20], [0, 0, 3, 30], [0, 0, 0, 1.0]])
        volume = tissueform.from_nibabel(nibabel.Nifti1Image(values, affine))
        np.testing.assert_array_equal(volume.values, values)
        world = nibabel.affines.apply_affine(affine, [1, 2, 3])
        np.testing.assert_allclose(places(volume, np.array([[1, 2, 3]]))[0], world * [-1, -1, 1])
        with self.assertRaisesRegex(InvalidInput, "4 axes"):
            tissueform.from_nibabel(nibabel.Nifti1Image(np.zeros((2, 2, 2, 2), np.int16), affine))

    def test_of_several_series_one_is_chosen(self):
        self.series("a/CT")
        short = self.series("b/CT")
        for file in sorted(short.iterdir())[40:]:
            file.unlink()
        self.refused(r"2 series of CT images: 0 has 93, 1 has 40 slices", self.folder)
        self.assertEqual(from_dicom(self.folder, series=1).values.shape, (64, 64, 40))
        self.refused("no series 2", self.folder, series=2)

    def test_what_is_no_plain_series_is_refused(self):
        files = sorted(self.series("whole").iterdir())
        self.refused("slices are missing", files[:30] + files[31:])
        self.refused("at least 3", files[:2])
        self.refused("there is no CT image", [SOURCE / "README.md"], NotFound)
        self.refused("no such file", self.folder / "none", NotFound)
        copy = self.folder / "again.dcm"
        copy.write_bytes(files[3].read_bytes())
        self.refused("several scans", [*files, copy])

        def tilt(image, index):
            image.ImagePositionPatient = [100, -100 + 0.4 * index, -1.5 * index]
        self.refused("tilted", self.series("tilted", alter=tilt))

        def other_size(image, index):
            image.PixelSpacing = [3.2, 3.2 if index < 50 else 3.3]
        self.refused("differ", self.series("differ", alter=other_size))

        def frames(image, index):
            image.NumberOfFrames = 2
        self.refused("several frames", self.series("frames", alter=frames))

        def no_position(image, index):
            del image.ImagePositionPatient
        self.refused("no position", self.series("nowhere", alter=no_position))

        def cut_off(image, index):
            image.PixelData = image.PixelData[:1000]
        self.refused("cannot be decoded", self.series("cut", alter=cut_off))

    def test_warnings_quote_nothing_of_the_files(self):
        def wrong(image, index):
            image.SpecificCharacterSet = "DEMO-1"
            image.PixelData += bytes(64)

        def warned(read):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                read()
            return " ".join(str(warning.message) for warning in caught)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            files = self.series(alter=wrong)
        first = next(files.iterdir())
        self.assertRegex(warned(lambda: pydicom.dcmread(first).pixel_array), "DEMO-1.*padding")
        self.assertEqual(warned(lambda: from_dicom(files)), "")


if __name__ == "__main__":
    unittest.main()
