// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/build_inputs.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "nlohmann/json.hpp"

#include "core/base/archive/stored_zip.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/meta_image.h"
#include "core/imaging/labels/bare_label_map.h"
#include "core/planning/plan_building/recipe.h"
#include "core/planning/plan_building/surfaces_file.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxPathBytes = 128;
constexpr char kSurfacesFile[] = "surfaces.json";

bool IsPlain(absl::string_view path) {
  if (path.empty() || path.size() > kMaxPathBytes) return false;
  for (const absl::string_view part : absl::StrSplit(path, '/')) {
    const bool is_plain =
        !part.empty() && part != "." && part != ".." && std::ranges::all_of(part, [](char c) {
          return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '_' ||
                 c == '-';
        });
    if (!is_plain) return false;
  }
  return true;
}

// Whether the value at a JSON pointer of a recipe or a surfaces file is the path of a file.
bool NamesFile(absl::string_view pointer) {
  return pointer != "/labels/file" &&
         (absl::EndsWith(pointer, "/file") || absl::EndsWith(pointer, "/transform") ||
          absl::EndsWith(pointer, "/mouth_line_file"));
}

absl::StatusOr<std::string> ReadFile(const fs::path& path, const std::string& what) {
  std::error_code error;
  const uintmax_t bytes = fs::is_regular_file(path, error) ? fs::file_size(path, error) : 0;
  std::string contents(error ? 0 : bytes, '\0');
  std::ifstream stream(path, std::ios::binary);
  if (error || !stream.read(contents.data(), static_cast<std::streamsize>(contents.size()))) {
    return absl::NotFoundError(absl::StrCat("cannot read ", what));
  }
  return contents;
}

// Its own name may hold a patient's, but it is one that the user has just written.
absl::StatusOr<std::vector<ZipMember>> ReadNamedFiles(const std::string& json,
                                                      const fs::path& folder) {
  TF_ASSIGN_OR_RETURN(const std::vector<std::string> paths, NamedFiles(json));
  std::vector<ZipMember> files;
  files.reserve(paths.size());
  for (const std::string& path : paths) {
    TF_ASSIGN_OR_RETURN(std::string bytes, ReadFile(folder / path, absl::StrCat("\"", path, "\"")));
    files.push_back({path, std::move(bytes)});
  }
  return files;
}

// The values as the file has them where the recipe has an offset: the other machine adds it.
absl::StatusOr<CtVolume> ReadWithoutOffset(const std::string& path, CtReadOptions options) {
  // First as the recipe says, so that what it says is checked here as there.
  absl::StatusOr<CtVolume> volume = ReadCtVolume(path, options);
  if (!volume.ok() || !options.hu_offset) return volume;
  options.hu_offset.reset();
  options.values = CtValues::kGray;
  TF_ASSIGN_OR_RETURN(CtVolume unchanged, ReadCtVolume(path, options));
  unchanged.provenance = std::move(volume->provenance);
  return unchanged;
}

absl::StatusOr<std::vector<std::string>> WriteCt(const std::string& path,
                                                 const CtReadOptions& options,
                                                 const fs::path& folder) {
  TF_ASSIGN_OR_RETURN(CtVolume volume, ReadWithoutOffset(path, options));
  TF_ASSIGN_OR_RETURN(const std::string file, MetaImageOf(volume));
  TF_RETURN_IF_ERROR(WriteFileAtomically((folder / BuildInputFiles::kCt).string(), file));
  return std::move(volume.provenance.notes);
}

absl::Status WriteLabels(const std::string& path, const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    return absl::InvalidArgumentError(
        "cannot send the label map: it is a folder of masks; store it as one .nrrd, .nii.gz or "
        ".mha, or build on this machine, without --server");
  }
  TF_ASSIGN_OR_RETURN(std::string file, ReadFile(path, "the label map"));
  TF_ASSIGN_OR_RETURN(const BareLabelMap bare, WithoutText(path, std::move(file)));
  return WriteFileAtomically(
      (folder / absl::StrCat(BuildInputFiles::kLabels, bare.ending)).string(), bare.bytes);
}

absl::Status WriteRecipeFiles(const std::string& recipe_path, const fs::path& folder) {
  TF_ASSIGN_OR_RETURN(const std::string json, ReadFile(recipe_path, "the recipe"));
  TF_ASSIGN_OR_RETURN(const std::vector<ZipMember> files,
                      ReadNamedFiles(json, fs::path(recipe_path).parent_path()));
  TF_RETURN_IF_ERROR(WriteFileAtomically((folder / BuildInputFiles::kRecipe).string(), json));
  for (const ZipMember& file : files) {
    const fs::path copy = folder / BuildInputFiles::kRecipeFiles / file.path;
    std::error_code error;
    fs::create_directories(copy.parent_path(), error);
    TF_RETURN_IF_ERROR(WriteFileAtomically(copy.string(), file.bytes));
  }
  return absl::OkStatus();
}

absl::Status WriteSurfaces(const std::string& path, int threads, const fs::path& folder) {
  // Only so that errors are found here.
  TF_RETURN_IF_ERROR(ReadSurfaces(path, threads).status());
  TF_ASSIGN_OR_RETURN(std::string json, ReadFile(path, "the surfaces file"));
  TF_ASSIGN_OR_RETURN(std::vector<ZipMember> members,
                      ReadNamedFiles(json, fs::path(path).parent_path()));
  members.push_back({kSurfacesFile, std::move(json)});
  TF_ASSIGN_OR_RETURN(const std::string zip, StoredZip(members));
  return WriteFileAtomically((folder / BuildInputFiles::kSurfaces).string(), zip);
}

}  // namespace

absl::StatusOr<std::vector<std::string>> NamedFiles(absl::string_view json) {
  const nlohmann::json parsed = nlohmann::json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!parsed.is_structured()) return absl::InvalidArgumentError("the file is not JSON");
  std::set<std::string> paths;
  const nlohmann::json values = parsed.flatten();
  for (const auto& [pointer, value] : values.items()) {
    if (!NamesFile(pointer) || !value.is_string()) continue;
    const auto path = value.get<std::string>();
    if (!IsPlain(path)) {
      return absl::InvalidArgumentError(absl::StrCat(
          pointer,
          " names a file that cannot be sent under this name; put it into the recipe's "
          "folder and name it with letters, digits, \".\", \"_\" and \"-\", at most ",
          kMaxPathBytes));
    }
    paths.insert(path);
  }
  return std::vector<std::string>(paths.begin(), paths.end());
}

absl::StatusOr<std::vector<std::string>> WriteBuildInputs(const PlanBuildRequest& request,
                                                          ZipInputs* zips) {
  const fs::path folder = request.folder;
  if (!request.surfaces.empty()) {
    TF_ASSIGN_OR_RETURN(const std::string surfaces,
                        zips->Resolve(request.surfaces, ZipContent::kSurfaces));
    TF_RETURN_IF_ERROR(WriteSurfaces(surfaces, request.threads, folder));
    return std::vector<std::string>();
  }
  TF_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipe(request.recipe));
  TF_RETURN_IF_ERROR(WriteRecipeFiles(request.recipe, folder));
  std::string labels = request.labels.empty() ? recipe.labels.file : request.labels;
  if (!labels.empty()) {
    TF_ASSIGN_OR_RETURN(labels, zips->Resolve(labels, ZipContent::kLabels));
    TF_RETURN_IF_ERROR(WriteLabels(labels, folder));
  }
  TF_ASSIGN_OR_RETURN(const std::string ct, zips->Resolve(request.ct, ZipContent::kCt));
  return WriteCt(ct, recipe.ct, folder);
}

}  // namespace tissueform
