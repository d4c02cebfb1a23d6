#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes slices of the bundled head as multi-frame DICOM files with pydicom: multi_frame.test.ts reads them.

Usage: write_multi_frame.py FOLDER

enhanced.dcm: an Enhanced CT whose frames are out of order, each with its own rescale; cone_beam.dcm: a file of the plain CT class
whose frames follow the first. For each a .raw holds what pydicom reads of it as int16 HU, in the order of its positions.
"""

import gzip
import os
import sys

import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian

SECRET = "Musterfrau"
SIZE = (93, 64, 64)
FIRST, COUNT = 30, 20
CT_CLASS = "1.2.840.10008.5.1.4.1.1.2"
SPACING_MM, STEP_MM = 3.2, 1.5
ORIGIN_MM = (-10.0, 20.0, 900.0)


def bundled():
    """Raw values (HU + 1024)."""
    path = os.path.join(os.path.dirname(__file__), "../../../../tests/data/ct/headsq/headsq_quarter.raw.gz")
    with gzip.open(path) as stream:
        values = np.frombuffer(stream.read(), "<i2").reshape(SIZE)
    return values[FIRST : FIRST + COUNT].clip(0, 4095)


def file_of(path, class_uid, values):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = class_uid
    meta.MediaStorageSOPInstanceUID = "1.2.3.77.500"
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data = FileDataset(path, {}, file_meta=meta, preamble=b"\0" * 128)
    data.is_little_endian, data.is_implicit_VR = True, False
    data.SOPClassUID, data.SOPInstanceUID = class_uid, "1.2.3.77.500"
    data.ImageType = ["ORIGINAL", "PRIMARY", "VOLUME", "NONE"]
    data.Modality = "CT"
    data.PatientName, data.PatientID = f"{SECRET}^Erika", f"{SECRET}-id"
    data.StudyInstanceUID, data.SeriesInstanceUID = "1.2.3.77", "1.2.3.77.1"
    data.FrameOfReferenceUID = "1.2.3.77.9"
    data.SeriesNumber, data.InstanceNumber = 4, 1
    data.NumberOfFrames, data.Rows, data.Columns = values.shape
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 12, 11, 0
    data.PixelData = values.astype("<u2").tobytes()
    return data


def groups(**items):
    group = Dataset()
    for name, values in items.items():
        item = Dataset()
        for key, value in values.items():
            setattr(item, key, value)
        setattr(group, name, [item])
    return group


def enhanced(path, values):
    order = np.random.default_rng(7).permutation(COUNT)
    data = file_of(path, "1.2.840.10008.5.1.4.1.1.2.1", values[order])
    data.SharedFunctionalGroupsSequence = [
        groups(
            PlaneOrientationSequence={"ImageOrientationPatient": [1, 0, 0, 0, 1, 0]},
            PixelMeasuresSequence={"PixelSpacing": [SPACING_MM, SPACING_MM], "SliceThickness": STEP_MM},
            CTReconstructionSequence={"ConvolutionKernel": "Br40"},
        )
    ]
    data.PerFrameFunctionalGroupsSequence = [
        groups(
            PlanePositionSequence={"ImagePositionPatient": [*ORIGIN_MM[:2], ORIGIN_MM[2] + STEP_MM * k]},
            # Halves, to see how they are rounded.
            PixelValueTransformationSequence={"RescaleSlope": 1 if k % 2 else 0.5, "RescaleIntercept": -1024, "RescaleType": "HU"},
            FrameContentSequence={"FrameAcquisitionNumber": 1, "FrameAcquisitionDateTime": "20200102101112.5"},
            # As long as scanners' headers are: the groups do not end within the first 64 KiB.
            CTExposureSequence={"ExposureTimeInms": 500.0, "ImageComments": "x" * 4000},
        )
        for k in order
    ]
    data.save_as(path, write_like_original=False)


def cone_beam(path, values):
    data = file_of(path, CT_CLASS, values)
    data.ImagePositionPatient, data.ImageOrientationPatient = list(ORIGIN_MM), [1, 0, 0, 0, 1, 0]
    data.PixelSpacing, data.SpacingBetweenSlices = [SPACING_MM, SPACING_MM], STEP_MM
    data.RescaleSlope, data.RescaleIntercept = 1, -1024
    data.save_as(path, write_like_original=False)


def rounded(hu):
    """Halves away from zero."""
    return (np.sign(hu) * np.floor(np.abs(hu) + 0.5)).astype("<i2")


def frame_of(data, index):
    """Height and HU of a frame, as pydicom gives them."""
    if "PerFrameFunctionalGroupsSequence" not in data:
        return index, data.pixel_array[index] * float(data.RescaleSlope) + float(data.RescaleIntercept)
    group = data.PerFrameFunctionalGroupsSequence[index]
    rescale = group.PixelValueTransformationSequence[0]
    hu = data.pixel_array[index] * float(rescale.RescaleSlope) + float(rescale.RescaleIntercept)
    return float(group.PlanePositionSequence[0].ImagePositionPatient[2]), hu


def write_expected(path):
    data = pydicom.dcmread(path)
    frames = sorted((frame_of(data, index) for index in range(COUNT)), key=lambda frame: frame[0])
    rounded(np.stack([hu for _, hu in frames])).tofile(path.replace(".dcm", ".raw"))


def main(folder):
    for write, name in ((enhanced, "enhanced.dcm"), (cone_beam, "cone_beam.dcm")):
        path = os.path.join(folder, name)
        write(path, bundled())
        write_expected(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
