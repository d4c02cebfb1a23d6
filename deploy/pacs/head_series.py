#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes the bundled head (tests/data/ct/headsq) as a DICOM CT series of an invented patient, by python3-pydicom.

  head_series.py FOLDER [--name NAME] [--id ID] [--born YYYYMMDD] [--study UID]

Prints StudyInstanceUID and SeriesInstanceUID.
"""

import argparse
import gzip
import pathlib
import uuid

import numpy
import pydicom
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian

SOURCE = pathlib.Path(__file__).resolve().parent.parent.parent / "tests/data/ct/headsq/headsq_quarter.raw.gz"
SHAPE = (93, 64, 64)
SPACING_MM = (3.2, 3.2)
SLICE_MM = 1.5


def new_uid():
    return f"2.25.{uuid.uuid4().int}"


def write_series(folder, name="Demo^Dora", patient_id="DEMO-1", born="19700101", study="", number=1, alter=lambda image, index: None):
    """UIDs of study and series; the files are those of the folder. `alter` may change an image before it is written."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    voxels = numpy.frombuffer(gzip.decompress(SOURCE.read_bytes()), dtype="<u2").reshape(SHAPE)
    study, series, frame = study or new_uid(), new_uid(), new_uid()
    for index, pixels in enumerate(voxels):
        meta = FileMetaDataset()
        meta.MediaStorageSOPClassUID = CTImageStorage
        meta.MediaStorageSOPInstanceUID = new_uid()
        meta.TransferSyntaxUID = ExplicitVRLittleEndian
        image = FileDataset(str(folder / f"{index:04}.dcm"), {}, file_meta=meta, preamble=b"\0" * 128)
        image.is_little_endian, image.is_implicit_VR = True, False
        image.SpecificCharacterSet = "ISO_IR 192"
        image.SOPClassUID = CTImageStorage
        image.SOPInstanceUID = meta.MediaStorageSOPInstanceUID
        image.PatientName, image.PatientID, image.PatientBirthDate, image.PatientSex = name, patient_id, born, "O"
        image.StudyInstanceUID, image.SeriesInstanceUID, image.FrameOfReferenceUID = study, series, frame
        image.StudyDate, image.StudyTime, image.StudyID, image.AccessionNumber = "20260102", "101500", "S1", f"A{number}"
        image.StudyDescription, image.SeriesDescription = "Head", "Head soft 1.5"
        image.ReferringPhysicianName, image.PositionReferenceIndicator = "", ""
        image.SeriesDate, image.ContentDate, image.AcquisitionDate = "20260102", "20260102", "20260102"
        image.SeriesTime, image.ContentTime, image.AcquisitionTime = "101600", "101600", "101600"
        image.Modality, image.Manufacturer, image.SeriesNumber = "CT", "Invented", "2"
        image.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
        image.ConvolutionKernel, image.KVP, image.PatientPosition = "H30s", "120", "HFS"
        image.InstanceNumber, image.AcquisitionNumber = str(index + 1), "1"
        # The bytes lie from the patient's left to the right, from front to back, from top to bottom.
        image.ImageOrientationPatient = [-1, 0, 0, 0, 1, 0]
        corner = [SPACING_MM[0] * 31.5, -SPACING_MM[1] * 31.5, -SLICE_MM * index]
        image.ImagePositionPatient = [f"{value:.1f}" for value in corner]
        image.Laterality = ""
        image.PixelSpacing, image.SliceThickness = list(SPACING_MM), str(SLICE_MM)
        image.Rows, image.Columns = SHAPE[1:]
        image.SamplesPerPixel, image.PhotometricInterpretation = 1, "MONOCHROME2"
        image.BitsAllocated, image.BitsStored, image.HighBit, image.PixelRepresentation = 16, 16, 15, 0
        image.RescaleIntercept, image.RescaleSlope, image.RescaleType = "-1024", "1", "HU"
        image.PixelData = pixels.tobytes()
        alter(image, index)
        image.save_as(image.filename, write_like_original=False)
    return study, series


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--name", default="Demo^Dora")
    parser.add_argument("--id", default="DEMO-1")
    parser.add_argument("--born", default="19700101")
    parser.add_argument("--study", default="")
    words = parser.parse_args()
    print(*write_series(words.folder, words.name, words.id, words.born, words.study), sep="\n")


if __name__ == "__main__":
    main()
