// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/method_table.h"

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

#include "tests/testing/test_paths.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {
namespace {

TEST(MethodTable, UnaryCallsAndDownloadsUseGrpcWeb) {
  EXPECT_EQ(KindOf("/tissueform.v1.MeshService/GetMesh"), MethodKind::kUnary);
  EXPECT_EQ(KindOf("/tissueform.v1.AccessService/WhoAmI"), MethodKind::kUnary);
  EXPECT_EQ(KindOf("/grpc.health.v1.Health/Check"), MethodKind::kUnary);
  for (const char* method :
       {"MeshService/GetSurface", "CaseService/ReadCase", "PredictionService/ReadPositions",
        "PredictionService/ComparePredictions", "DeformService/GetPreparedAnswers"}) {
    EXPECT_EQ(KindOf(absl::StrCat("/tissueform.v1.", method)), MethodKind::kDownload) << method;
  }
}

TEST(MethodTable, OtherAndUnknownMethodsDoNotUseGrpcWeb) {
  for (const char* method :
       {"/tissueform.v1.DeformService/Deform", "/tissueform.v1.DeformService/Watch",
        "/tissueform.v1.SessionService/PrepareSession", "/tissueform.v1.MeshService/UploadMesh",
        "/tissueform.v1.MeshService/NotYet", "/", ""}) {
    EXPECT_EQ(KindOf(method), MethodKind::kLong) << method;
  }
}

// The linker leaves out unreferenced services: a service that is added must be named in the table.
TEST(MethodTable, KnowsEveryMethodOfTheProtocol) {
  int found = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(testing::SourcePath("proto/tissueform/v1"))) {
    std::ifstream file(entry.path());
    const std::regex service_line("^service (\\w+) .*");
    const std::regex rpc_line("^  rpc (\\w+)\\(.*");
    std::string service;
    std::smatch match;
    for (std::string line; std::getline(file, line);) {
      if (std::regex_match(line, match, service_line)) service = match[1];
      if (!std::regex_match(line, match, rpc_line)) continue;
      const std::string method = absl::StrCat("/tissueform.v1.", service, "/", match[1].str());
      EXPECT_NE(AnswerOf(method), nullptr) << method;
      ++found;
    }
  }
  EXPECT_GE(found, 28);
}

TEST(MethodTable, TheLongestBytesOfAFrameAreItsPositions) {
  v1::DeformResponse response;
  response.mutable_frame()->set_sequence(7);
  response.mutable_frame()->set_positions(std::string(3000, 'p'));
  response.mutable_frame()->set_uncertainty_p95_mm(std::string(1000, 'u'));
  response.mutable_frame()->mutable_summary()->set_obstacle(std::string(5000, 'o'));
  const std::string bytes = response.SerializeAsString();
  const BytesPlace place = LongestBytes(bytes, *v1::DeformResponse::descriptor());
  EXPECT_EQ(bytes.substr(place.offset, place.size), std::string(3000, 'p'));
}

TEST(MethodTable, MessagesWithoutBytesHaveNoPlace) {
  v1::DeformResponse response;
  response.mutable_started()->set_vertex_count(4);
  const std::string bytes = response.SerializeAsString();
  EXPECT_EQ(LongestBytes(bytes, *v1::DeformResponse::descriptor()).size, 0U);
  EXPECT_EQ(LongestBytes("", *v1::DeformResponse::descriptor()).size, 0U);
}

TEST(MethodTable, MalformedMessageYieldsNoPlaceOutsideIt) {
  v1::DeformResponse response;
  response.mutable_frame()->set_positions(std::string(300, 'p'));
  const std::string bytes = response.SerializeAsString();
  for (size_t size = 1; size < bytes.size(); ++size) {
    const BytesPlace place = LongestBytes(bytes.substr(0, size), *v1::DeformResponse::descriptor());
    EXPECT_LE(place.offset + place.size, size);
  }
  EXPECT_EQ(LongestBytes("\xff\xff\xff", *v1::DeformResponse::descriptor()).size, 0U);
}

}  // namespace
}  // namespace tissueform
