// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/volume_file_reader.h"

#include <cmath>
#include <itkImageFileReader.h>
#include <itkMetaDataObject.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkVectorImage.h>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/imaging/ct/file_bytes.h"
#include "core/imaging/ct/hu_check.h"
#include "core/imaging/ct/nifti_header.h"
#include "core/imaging/ct/patient_axes.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

using Image = itk::VectorImage<float, 3>;

constexpr double kLeastSpacingMm = 0.05;
constexpr double kMaxSpacingMm = 10;

const char* NameOf(VolumeFormat format) {
  switch (format) {
    case VolumeFormat::kNifti:
      return "NIfTI";
    case VolumeFormat::kNrrd:
      return "NRRD";
    case VolumeFormat::kMetaImage:
      return "MetaImage";
  }
  return "";
}

// ITK's reader of NIfTI, which also reads the voxels of a file whose axes are not square to each
// other. Their directions are then those of the header (nifti_header.h).
class NiftiIo : public itk::NiftiImageIO {
 public:
  using Self = NiftiIo;
  using Pointer = itk::SmartPointer<Self>;
  itkFactorylessNewMacro(Self);

  void ReadImageInformation() override {
    try {
      NiftiImageIO::ReadImageInformation();
    } catch (const itk::ExceptionObject& exception) {
      if (!absl::StrContains(exception.GetDescription(), "rthonormal")) throw;
      axes_are_square_ = false;
    }
  }
  bool AxesAreSquare() const { return axes_are_square_; }

 private:
  bool axes_are_square_ = true;
};

itk::ImageIOBase::Pointer MakeIo(VolumeFormat format) {
  switch (format) {
    case VolumeFormat::kNifti:
      return NiftiIo::New().GetPointer();
    case VolumeFormat::kNrrd:
      return itk::NrrdImageIO::New().GetPointer();
    case VolumeFormat::kMetaImage:
      return itk::MetaImageIO::New().GetPointer();
  }
  return nullptr;
}

absl::Status Damaged() {
  return absl::InvalidArgumentError("the file is cut off, damaged, or not of its ending's format");
}

// ITK's messages hold paths, and several lines.
absl::Status ExplainFailure(const itk::ExceptionObject& exception) {
  if (absl::StrContains(exception.GetDescription(), "nrrdSpacingStatusScalarWithSpace")) {
    return absl::InvalidArgumentError(
        "the header has \"spacings\" beside a \"space\", which needs \"space directions\"; take "
        "the "
        "line \"space\" out of it and state \"axes\" in the recipe");
  }
  return Damaged();
}

// What the file and those beside it hold.
struct FileContents {
  std::string file;
  std::string data_file;  // where there is one
  std::string digests;    // of all, one after the other
};

absl::StatusOr<FileContents> ReadContents(const std::string& path, const VolumeHeader& header,
                                          int64_t max_bytes) {
  FileContents contents;
  TF_ASSIGN_OR_RETURN(contents.file, ReadWholeFile(path, &max_bytes));
  contents.digests = Sha256Hex({contents.file});
  for (const std::string& data_path : header.data_paths) {
    TF_ASSIGN_OR_RETURN(contents.data_file, ReadWholeFile(data_path, &max_bytes));
    contents.digests += Sha256Hex({contents.data_file});
  }
  return contents;
}

CtProvenance ProvenanceOf(VolumeFormat format, const VolumeHeader& header,
                          const FileContents& contents) {
  CtProvenance provenance;
  provenance.format = NameOf(format);
  provenance.num_files = 1 + static_cast<int>(header.data_paths.size());
  provenance.sha256 = header.data_paths.empty() ? contents.digests : Sha256Hex({contents.digests});
  return provenance;
}

bool HoldsAllOfNifti(const std::string& file, const NiftiHeader& header,
                     const itk::ImageIOBase& io) {
  // The bits in the file: ITK reports those after scaling.
  const double bytes = header.voxel_offset + static_cast<double>(io.GetImageSizeInPixels()) *
                                                 static_cast<double>(header.voxel_bits) / 8;
  if (!(header.voxel_offset >= 0 && header.voxel_bits > 0 && bytes < 1e15)) return false;
  const auto needed = static_cast<int64_t>(bytes);
  return (IsGzip(file) ? UnpackedSize(file, needed) : static_cast<int64_t>(file.size())) >= needed;
}

bool HoldsAllOfMetaImage(const VolumeHeader& header, const FileContents& contents,
                         const itk::ImageIOBase& io) {
  const auto bytes = static_cast<int64_t>(io.GetImageSizeInBytes());
  const bool local = header.data_paths.empty();
  absl::string_view data = contents.data_file;
  if (local) data = absl::string_view(contents.file).substr(header.data_offset);
  if (!header.compressed) return static_cast<int64_t>(data.size()) >= bytes;
  // Without the size ITK would take the header for data.
  if (local && header.compressed_bytes == 0) return false;
  if (header.compressed_bytes > 0) data = data.substr(0, header.compressed_bytes);
  return UnpackedSize(data, bytes) >= bytes;
}

// ITK fills up with anything what is missing from NIfTI and MetaImage: so the bytes are counted
// against the header before ITK reads them.
bool HoldsAllVoxels(VolumeFormat format, const VolumeHeader& header, const FileContents& contents,
                    const std::optional<NiftiHeader>& nifti, const itk::ImageIOBase& io) {
  switch (format) {
    case VolumeFormat::kNifti:
      return nifti && HoldsAllOfNifti(contents.file, *nifti, io);
    case VolumeFormat::kMetaImage:
      return HoldsAllOfMetaImage(header, contents, io);
    case VolumeFormat::kNrrd:
      return true;  // its library sees to it
  }
  return false;
}

struct Orientation {
  bool stated = false;
  std::string where;  // what is there instead
};

Orientation OrientationOf(VolumeFormat format, const VolumeHeader& header,
                          const std::optional<NiftiHeader>& nifti) {
  const std::string quoted = absl::StrCat("\"", header.orientation.substr(0, 40), "\"");
  switch (format) {
    case VolumeFormat::kNifti:
      return {nifti && nifti->StatesPlace(), "NIfTI with qform_code and sform_code 0"};
    case VolumeFormat::kNrrd: {
      const std::string space = absl::AsciiStrToLower(header.orientation);
      const bool stated = space == "left-posterior-superior" || space == "lps" ||
                          space == "right-anterior-superior" || space == "ras" ||
                          space == "left-anterior-superior" || space == "las";
      return {stated, header.orientation.empty() ? "NRRD without \"space\""
                                                 : absl::StrCat("NRRD with \"space\" ", quoted)};
    }
    case VolumeFormat::kMetaImage: {
      const bool stated =
          header.orientation.size() == 3 && !absl::StrContains(header.orientation, '?');
      return {stated, "MetaImage without \"AnatomicalOrientation\""};
    }
  }
  return {};
}

absl::Status CheckShape(const itk::ImageIOBase& io, const VolumeFileRules& rules) {
  if (io.GetNumberOfComponents() > static_cast<unsigned>(rules.max_components)) {
    if (rules.max_components > 1) {
      return absl::ResourceExhaustedError(absl::StrCat("the file has ", io.GetNumberOfComponents(),
                                                       " layers; at most ", rules.max_components,
                                                       " are read"));
    }
    return absl::InvalidArgumentError(absl::StrCat("the file holds ", io.GetNumberOfComponents(),
                                                   " numbers a voxel (colour or vectors); a CT "
                                                   "has one"));
  }
  for (unsigned axis = 3; axis < io.GetNumberOfDimensions(); ++axis) {
    if (io.GetDimensions(axis) > 1) {
      return absl::InvalidArgumentError(absl::StrCat("the file holds ", io.GetDimensions(axis),
                                                     " volumes; extract the one to use"));
    }
  }
  double voxels = io.GetNumberOfComponents();
  for (unsigned axis = 0; axis < 3; ++axis) {
    const auto size = axis < io.GetNumberOfDimensions() ? io.GetDimensions(axis) : 1;
    if (size < static_cast<size_t>(rules.least_voxels)) {
      return absl::InvalidArgumentError(
          absl::StrCat("the file has ", size, " voxels along its axis ", axis + 1,
                       "; a volume needs at least ", rules.least_voxels));
    }
    voxels *= static_cast<double>(size);
  }
  if (voxels > static_cast<double>(rules.max_voxels)) {
    return absl::ResourceExhaustedError(absl::StrCat("the volume has ", voxels, " voxels; at most ",
                                                     rules.max_voxels, " are read"));
  }
  return absl::OkStatus();
}

void TakeGeometry(const Image& image, CtVolume* volume) {
  for (unsigned axis = 0; axis < 3; ++axis) {
    volume->size[axis] = static_cast<int>(image.GetLargestPossibleRegion().GetSize()[axis]);
    volume->spacing_mm[axis] = image.GetSpacing()[axis];
    volume->origin_mm[axis] = image.GetOrigin()[axis];
    for (unsigned row = 0; row < 3; ++row) {
      volume->direction(row, axis) = image.GetDirection()(row, axis);
    }
  }
}

// Where ITK does not place the volume as the header says.
absl::Status CorrectGeometry(const NiftiHeader& nifti, const itk::ImageIOBase& io,
                             CtVolume* volume) {
  TF_RETURN_IF_ERROR(CheckForms(nifti));
  const bool is_right = dynamic_cast<const NiftiIo&>(io).AxesAreSquare() && !nifti.NeedsScale();
  return is_right || !nifti.StatesPlace() ? absl::OkStatus() : PlaceByHeader(nifti, volume);
}

absl::Status CheckGeometry(const CtVolume& volume, bool scaled) {
  for (int axis = 0; axis < 3; ++axis) {
    const double spacing = volume.spacing_mm[axis];
    if (spacing >= kLeastSpacingMm && spacing <= kMaxSpacingMm) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "the voxels are ", spacing, " mm apart along axis ", axis + 1, "; between ",
        kLeastSpacingMm, " and ", kMaxSpacingMm, " mm are read",
        scaled ? "; the file does not state millimeters: if it has them, set xyzt_units to 2"
               : ""));
  }
  if (!volume.origin_mm.allFinite() || !volume.direction.allFinite()) {
    return absl::InvalidArgumentError("the file places its voxels at no finite position");
  }
  return absl::OkStatus();
}

absl::StatusOr<CtVolume> TakeHu(VolumeFileValues file, double offset) {
  CtVolume volume = std::move(file.placed);
  volume.hu.resize(file.values.size());
  for (size_t i = 0; i < file.values.size(); ++i) {
    if (!std::isfinite(file.values[i])) {
      return absl::InvalidArgumentError(
          absl::StrCat("voxel ", i, " is not a number; replace such voxels by air"));
    }
    volume.hu[i] = ToStored(file.values[i] + offset);
  }
  return volume;
}

std::map<std::string, std::string> TextsOf(const itk::MetaDataDictionary& dictionary) {
  std::map<std::string, std::string> texts;
  for (const std::string& key : dictionary.GetKeys()) {
    std::string value;
    if (itk::ExposeMetaData(dictionary, key, value)) texts[key] = value;
  }
  return texts;
}

absl::Status ReadWithItk(const std::string& path, VolumeFormat format, const VolumeHeader& header,
                         const FileContents& contents, const VolumeFileRules& rules,
                         const std::function<absl::Status(VolumeFileValues)>& take) {
  const itk::ImageIOBase::Pointer io = MakeIo(format);
  io->SetFileName(path);
  io->ReadImageInformation();
  TF_RETURN_IF_ERROR(CheckShape(*io, rules));
  std::optional<NiftiHeader> nifti;
  if (format == VolumeFormat::kNifti) {
    nifti = ParseNiftiHeader(UnpackedStart(contents.file, kNiftiHeaderBytes));
  }
  if (!HoldsAllVoxels(format, header, contents, nifti, *io)) return Damaged();
  const auto reader = itk::ImageFileReader<Image>::New();
  reader->SetImageIO(io);
  reader->SetFileName(path);
  reader->Update();
  const Image& image = *reader->GetOutput();
  VolumeFileValues file;
  CtVolume& volume = file.placed;
  volume.provenance = ProvenanceOf(format, header, contents);
  TakeGeometry(image, &volume);
  if (nifti) TF_RETURN_IF_ERROR(CorrectGeometry(*nifti, *io, &volume));
  TF_RETURN_IF_ERROR(CheckGeometry(volume, nifti && nifti->NeedsScale()));
  const Orientation orientation = OrientationOf(format, header, nifti);
  const std::string axes = orientation.stated && rules.spare_axes ? "" : rules.axes;
  TF_RETURN_IF_ERROR(PlaceVolume(orientation.stated, orientation.where, axes, &volume));
  file.components = static_cast<int>(image.GetNumberOfComponentsPerPixel());
  file.values = {image.GetBufferPointer(),
                 static_cast<size_t>(volume.num_voxels()) * static_cast<size_t>(file.components)};
  file.texts = TextsOf(io->GetMetaDataDictionary());
  return take(std::move(file));
}

}  // namespace

absl::Status ReadVolumeFileValues(const std::string& path, VolumeFormat format,
                                  const VolumeFileRules& rules,
                                  const std::function<absl::Status(VolumeFileValues)>& take) {
  TF_ASSIGN_OR_RETURN(const VolumeHeader header, ReadVolumeHeader(path, format));
  TF_ASSIGN_OR_RETURN(const FileContents contents,
                      ReadContents(path, header, rules.max_file_bytes));
  try {
    return ReadWithItk(path, format, header, contents, rules, take);
  } catch (const itk::ExceptionObject& exception) {
    return ExplainFailure(exception);
  }
}

absl::StatusOr<CtVolume> ReadVolumeFile(const std::string& path, VolumeFormat format,
                                        const CtReadOptions& options) {
  absl::StatusOr<CtVolume> volume = Damaged();
  TF_RETURN_IF_ERROR(ReadVolumeFileValues(path, format,
                                          {.axes = options.axes,
                                           .max_file_bytes = options.limits.max_file_bytes,
                                           .max_voxels = options.limits.max_voxels},
                                          [&](VolumeFileValues file) {
                                            volume = TakeHu(std::move(file),
                                                            options.hu_offset.value_or(0));
                                            if (!volume.ok()) return volume.status();
                                            return SettleValues(options, true, &*volume);
                                          }));
  return volume;
}

}  // namespace tissueform
