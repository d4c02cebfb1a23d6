// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/prediction_objects.h"

#include <cstring>
#include <limits>
#include <set>

#include "absl/strings/match.h"
#include "gmock/gmock.h"

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/objects/stl_object.h"
#include "tests/client/pacs_bridge/objects/objects_fixture.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class PredictionObjectsTest : public ObjectsFixture {
 protected:
  // Of an element with its tag and everything below, as it is in a file.
  static std::string Raw(DcmItem* item, const DcmTagKey& tag) {
    DcmElement* element = nullptr;
    if (item->findAndGetElement(tag, element).bad()) return "none";
    OFString value;
    element->getOFStringArray(value, OFFalse);
    return value.c_str();
  }

  std::vector<WrittenObject> WriteAll(const PredictionObjectsInput& input) const {
    return WritePredictionObjects(input, (folder_ / "out").string())
        .value_or(std::vector<WrittenObject>{});
  }

  absl::Status Refusal(const PredictionObjectsInput& input) const {
    return WritePredictionObjects(input, (folder_ / "out").string()).status();
  }

  static std::string Stl(const std::string& path) {
    const auto file = Load(path);
    const Uint8* bytes = nullptr;
    unsigned long count = 0;
    Uint32 length = 0;
    file->getDataset()->findAndGetUint8Array(DCM_EncapsulatedDocument, bytes, &count);
    file->getDataset()->findAndGetUint32(DCM_EncapsulatedDocumentLength, length);
    EXPECT_TRUE(count == length || count == length + 1);
    return {reinterpret_cast<const char*>(bytes), length};
  }

  static Eigen::Vector3f Corner(const std::string& stl, size_t triangle, size_t corner) {
    Eigen::Vector3f point;
    std::memcpy(point.data(), stl.data() + 84 + 50 * triangle + 12 * (1 + corner), sizeof(point));
    return point;
  }
};

TEST_F(PredictionObjectsTest, EveryKeyIsWrittenOnceWithItsUids) {
  const PredictionObjectsInput input = MakeInput();
  std::vector<std::string> keys;
  std::set<std::string> series;
  for (const WrittenObject& object : WriteAll(input)) {
    keys.push_back(object.key);
    series.insert(object.series_uid);
    const auto file = Load(object.path);
    DcmDataset* dataset = file->getDataset();
    EXPECT_EQ(Value(dataset, DCM_SOPInstanceUID), input.uids.at(object.key));
    EXPECT_EQ(Value(dataset, DCM_SOPClassUID), object.class_uid);
    EXPECT_EQ(Value(dataset, DCM_SeriesInstanceUID), input.uids.at(SeriesKeyOf(object.key)));
    EXPECT_EQ(object.instance_uid, input.uids.at(object.key));
    EXPECT_EQ(Value(file->getMetaInfo(), DCM_TransferSyntaxUID), kExplicitLittleEndian);
    EXPECT_THAT(Value(dataset, DCM_SeriesDescription), HasSubstr(kResearchNotice));
  }
  EXPECT_THAT(keys,
              ElementsAre("stl:skin", "stl:skin-before", "stl:segment:top", "capture", "report"));
  EXPECT_EQ(keys, ObjectKeys(input.contents));
  EXPECT_EQ(series.size(), 3U);
}

TEST_F(PredictionObjectsTest, FilesAreAccessibleOnlyToTheirOwner) {
  for (const WrittenObject& object : WriteAll(MakeInput())) {
    EXPECT_EQ(std::filesystem::status(object.path).permissions(),
              std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    EXPECT_EQ(std::filesystem::path(object.path).filename().string(), object.instance_uid + ".dcm");
  }
}

TEST_F(PredictionObjectsTest, TheSameInputGivesTheSameBytes) {
  const PredictionObjectsInput input = MakeInput();
  std::map<std::string, std::string> first;
  for (const auto& [key, object] : Write(input)) first[key] = BytesOfFile(object.path);
  for (const auto& [key, object] : Write(input))
    EXPECT_EQ(BytesOfFile(object.path), first[key]) << key;
}

TEST_F(PredictionObjectsTest, ModelsCarryDescriptiveAttributes) {
  const PredictionObjectsInput input = MakeInput();
  const auto objects = Write(input);
  for (const auto& [key, object] : objects) {
    if (!absl::StartsWith(key, "stl:")) continue;
    const auto file = Load(object.path);
    DcmDataset* dataset = file->getDataset();
    EXPECT_EQ(Value(dataset, DCM_FrameOfReferenceUID), series_.frame_uid) << key;
    EXPECT_EQ(Value(dataset, DCM_ModelGroupUID), input.uids.at("group")) << key;
    EXPECT_EQ(Value(dataset, DCM_ModelModification), key == "stl:skin-before" ? "NO" : "YES");
    EXPECT_EQ(Value(dataset, DCM_RecognizableVisualFeatures), "YES");
    EXPECT_THAT(Value(dataset, DCM_DocumentTitle), HasSubstr(kResearchNotice));
    DcmItem* unit = nullptr;
    ASSERT_TRUE(dataset->findAndGetSequenceItem(DCM_MeasurementUnitsCodeSequence, unit).good());
    EXPECT_EQ(Value(unit, DCM_CodeValue), "mm");
    EXPECT_EQ(Value(unit, DCM_CodingSchemeDesignator), "UCUM");
    DcmItem* icon = nullptr;
    ASSERT_TRUE(dataset->findAndGetSequenceItem(DCM_IconImageSequence, icon).good());
    EXPECT_EQ(Value(icon, DCM_Rows), "64");
  }
}

TEST_F(PredictionObjectsTest, ASegmentThatStaysIsNotModified) {
  PredictionObjectsInput input = MakeInput();
  input.prediction.clear_poses();
  *input.prediction.add_poses() = ToProto(NamedPose{"top", {}});
  EXPECT_EQ(
      Value(Load(Write(input).at("stl:segment:top").path)->getDataset(), DCM_ModelModification),
      "NO");
}

TEST_F(PredictionObjectsTest, TheStlHasTheSurfacesTrianglesInPlace) {
  const PredictionObjectsInput input = MakeInput();
  const auto objects = Write(input);
  const CaseSurface& skin = input.contents.surfaces[0];
  const std::string before = Stl(objects.at("stl:skin-before").path);
  const std::string after = Stl(objects.at("stl:skin").path);
  const auto count = static_cast<size_t>(skin.triangles.rows());
  ASSERT_EQ(before.size(), 84 + 50 * count);
  ASSERT_EQ(after.size(), 84 + 50 * count);
  EXPECT_THAT(before.substr(0, 5), Not("solid"));
  for (size_t f = 0; f < count; ++f) {
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f rest =
          skin.positions.row(skin.triangles(static_cast<int>(f), static_cast<int>(k)));
      EXPECT_EQ(Corner(before, f, k), rest);
      const Eigen::Vector3d moved = ApplyPose(Pose(), rest.cast<double>());
      EXPECT_LT((Corner(after, f, k).cast<double>() - moved).norm(), 1e-5);
    }
  }
}

TEST_F(PredictionObjectsTest, SourceImagesAreReferred) {
  const PredictionObjectsInput input = MakeInput();
  const auto objects = Write(input);
  const auto count = [&](const std::string& key, const DcmTagKey& tag) {
    const auto file = Load(objects.at(key).path);
    DcmSequenceOfItems* sequence = nullptr;
    file->getDataset()->findAndGetSequence(tag, sequence, OFTrue);
    return sequence == nullptr ? 0UL : sequence->card();
  };
  EXPECT_EQ(count("stl:skin", DCM_SourceInstanceSequence), series_.instance_uids.size());
  EXPECT_EQ(count("capture", DCM_SourceImageSequence), series_.instance_uids.size());
  for (const char* key : {"stl:skin", "capture", "report"}) {
    const std::string bytes = BytesOfFile(objects.at(key).path);
    for (const std::string& uid : series_.instance_uids) EXPECT_THAT(bytes, HasSubstr(uid)) << key;
    EXPECT_THAT(bytes, HasSubstr(series_.series_uid)) << key;
  }
}

// Byte for byte, in any character set.
struct PatientCase {
  const char* word;
  const char* character_set;
  const char* name;
};

class PatientTest : public PredictionObjectsTest,
                    public ::testing::WithParamInterface<PatientCase> {};

TEST_P(PatientTest, PatientAndStudyAreTheSources) {
  CtSeriesOptions options;
  options.character_set = GetParam().character_set;
  options.patient_name = GetParam().name;
  const PredictionObjectsInput input = MakeInput(options);
  const auto source = Load(input.source_header);
  for (const WrittenObject& object : WriteAll(input)) {
    const auto file = Load(object.path);
    for (const DcmTagKey& tag :
         {DCM_SpecificCharacterSet, DCM_PatientName, DCM_PatientID, DCM_IssuerOfPatientID,
          DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyInstanceUID, DCM_StudyID, DCM_StudyDate,
          DCM_StudyTime, DCM_AccessionNumber, DCM_ReferringPhysicianName, DCM_StudyDescription}) {
      EXPECT_EQ(Raw(file->getDataset(), tag), Raw(source->getDataset(), tag))
          << object.key << " " << tag.toString();
    }
    EXPECT_EQ(Raw(file->getDataset(), DCM_PatientName), GetParam().name);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Patients, PatientTest,
    ::testing::Values(PatientCase{"Ascii", "", "Planted^Patricia^Q"},
                      PatientCase{"Latin1", "ISO_IR 100", "M\xfcller^J\xf6rg"},
                      PatientCase{"Utf8", "ISO_IR 192",
                                  "Wang^XiaoDong=\xe7\x8e\x8b^\xe5\xb0\x8f\xe4\xb8\x9c"},
                      PatientCase{"Iso2022", "\\ISO 2022 IR 87",
                                  "Yamada^Tarou=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B"}),
    [](const auto& patient) { return std::string(patient.param.word); });

TEST_F(PredictionObjectsTest, PathsAndContentsLeakNoPrivatePatientData) {
  CtSeriesOptions options;
  options.private_text = std::string(40'000, 'x') + "Planted^Private";
  for (const WrittenObject& object : WriteAll(MakeInput(options))) {
    EXPECT_THAT(object.path, Not(HasSubstr("Planted")));
    EXPECT_THAT(BytesOfFile(object.path), Not(HasSubstr("Planted^Private")));  // private tags stay
  }
}

TEST_F(PredictionObjectsTest, ANameThatNoObjectCanHoldIsRefusedWithoutIt) {
  PredictionObjectsInput input = MakeInput();
  const auto source = Load(input.source_header);
  // Only the implicit syntax has room for it.
  source->getDataset()->putAndInsertString(DCM_PatientName, std::string(100'000, 'P').c_str());
  input.source_header = folder_ / "long.dcm";
  ASSERT_TRUE(source->saveFile(input.source_header.c_str(), EXS_LittleEndianImplicit).good());
  const absl::Status refused = Refusal(input);
  EXPECT_THAT(refused.message(), AllOf(HasSubstr("(0010,0010)"), HasSubstr("100000 bytes")));
  EXPECT_THAT(refused.message(), Not(HasSubstr("PPPP")));
  EXPECT_THAT(std::filesystem::is_empty(folder_ / "out"), true);
}

TEST_F(PredictionObjectsTest, AHeaderWithoutPixelsIsEnough) {
  PredictionObjectsInput input = MakeInput();
  const std::string header = folder_ / "header.dcm";
  ASSERT_THAT(CopyHeaderOnly(input.source_header, header), IsOk());
  const std::string with_pixels = BytesOfFile(Write(input).at("stl:skin").path);
  input.source_header = header;
  EXPECT_EQ(BytesOfFile(Write(input).at("stl:skin").path), with_pixels);
}

TEST_F(PredictionObjectsTest, TimesAreInTheZoneOfTheStudy) {
  PredictionObjectsInput input = MakeInput();
  const auto source = Load(input.source_header);
  source->getDataset()->putAndInsertString(DCM_TimezoneOffsetFromUTC, "+0530");
  input.source_header = folder_ / "zone.dcm";
  ASSERT_TRUE(source->saveFile(input.source_header.c_str(), EXS_LittleEndianExplicit).good());
  const auto file = Load(Write(input).at("report").path);
  EXPECT_EQ(Value(file->getDataset(), DCM_ContentTime), "194320");  // 14:13:20 UTC
}

TEST_F(PredictionObjectsTest, BadInputIsRefusedByName) {
  const PredictionObjectsInput good = MakeInput();
  PredictionObjectsInput bad = good;
  bad.uids.erase("capture");
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("the UID of \"capture\""));
  bad = good;
  bad.uids["report"] = bad.uids["capture"];
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("to another object"));
  bad = good;
  bad.source_images.clear();
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("0 source images"));
  bad = good;
  bad.band_mm.pop_back();
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("band of uncertainty"));
  bad = good;
  bad.measures[0].set_unit("kg");
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("a unit other than"));
  bad = good;
  bad.measures[0].set_after(std::numeric_limits<double>::infinity());
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("an invalid number"));
  bad = good;
  bad.prediction.clear_poses();
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("no pose for the handle"));
  bad = good;
  bad.pictures.push_back(MakePicture(4, 32));
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("its size differs"));
  bad = good;
  bad.pictures = {MakePicture(5, 2049, 1)};
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("more than 2048 pixels"));
  bad = good;
  std::filesystem::resize_file(MakePicture(6), 200);
  bad.pictures[2] = folder_ / "picture6.png";
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("damaged or truncated"));
  bad.pictures[2] = folder_ / "nowhere.png";
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("no such picture"));
  bad = good;
  bad.pictures.back() = bad.source_header;
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("not a readable PNG"));
  bad = good;
  bad.source_header = bad.pictures[0];
  EXPECT_THAT(Refusal(bad).message(), HasSubstr("not a DICOM file"));
}

TEST_F(PredictionObjectsTest, ASourceWithoutAFrameOfReferenceIsRefused) {
  PredictionObjectsInput input = MakeInput();
  const auto source = Load(input.source_header);
  delete source->getDataset()->remove(DCM_FrameOfReferenceUID);
  input.source_header = folder_ / "nowhere.dcm";
  ASSERT_TRUE(source->saveFile(input.source_header.c_str(), EXS_LittleEndianExplicit).good());
  EXPECT_THAT(Refusal(input).message(), HasSubstr("FrameOfReferenceUID"));
}

}  // namespace
}  // namespace tissueform::testing
