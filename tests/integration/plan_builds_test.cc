// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/parallel_for.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/plan_building/plan_build_call.h"
#include "tests/integration/access_calls.h"
#include "tests/integration/service_test.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/test_paths.h"
#include "tissueform/v1/plan_build_service.grpc.pb.h"

// Plans that a server builds, by the real programs and the bundled CT.
namespace tissueform::testing {
namespace {

using Caller = AccessWorld::Caller;
using Code = grpc::StatusCode;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kRecipe[] = R"({"format": "tissueform-recipe", "version": 1,
  "ct": {"hu_offset": -1024, "axes": "RPI"}, "mesh": {"edge_mm": 5, "fine_edge_mm": 4},
  "segments": [{"name": "mandible", "osteotomy": "bssro",
                "pose": {"translation_mm": [0, -4, 0]}}]})";

// Sanitizers make a build some ten times as long.
constexpr auto kMostOfABuild = std::chrono::minutes(10);

// The bundled CT in one file, as a client would send it.
std::string OneFileOfTheCt() {
  std::string file;
  const std::string header = BytesOfFile(SourcePath("tests/data/ct/headsq/headsq_quarter.nhdr"));
  for (const absl::string_view line : absl::StrSplit(header, '\n', absl::SkipEmpty())) {
    if (line.substr(0, 10) != "data file:") absl::StrAppend(&file, line, "\n");
  }
  return absl::StrCat(file, "\n",
                      BytesOfFile(SourcePath("tests/data/ct/headsq/headsq_quarter.raw.gz")));
}

class PlanBuildsOfServerTest : public ServiceTest {
 protected:
  void Start(const PlanBuildLimits& limits = {}) {
    ServerOptions options = TestOptions();
    options.plan_builds = limits;
    options.workers = AvailableProcessors();
    StartServer(options, &callers_);
    stub_ = v1::PlanBuildService::NewStub(OwnChannel());
  }
  void TearDown() override {
    stub_.reset();
    StopServer();
  }

  grpc::Status Send(const Caller& caller, const std::string& bytes, const std::string& suffix,
                    size_t from, v1::BuildFile* file) {
    const auto context = ContextOf(caller);
    const auto writer = stub_->UploadBuildFile(context.get(), file);
    v1::UploadBuildFileRequest request;
    request.mutable_header()->set_sha256(Sha256Hex({bytes}));
    request.mutable_header()->set_total_bytes(static_cast<int64_t>(bytes.size()));
    request.mutable_header()->set_suffix(suffix);
    writer->Write(request);
    for (size_t at = from; at < bytes.size(); at += kChunk) {
      v1::BuildFileChunk& chunk = *request.mutable_chunk();
      chunk.set_write_offset(static_cast<int64_t>(at));
      chunk.set_data(bytes.substr(at, kChunk));
      chunk.set_finish_write(at + kChunk >= bytes.size());
      if (!writer->Write(request)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }

  v1::CreatePlanBuildRequest RequestOf(const v1::BuildFile& file) const {
    v1::CreatePlanBuildRequest request;
    request.set_ct(file.name());
    request.set_recipe_json(kRecipe);
    request.set_title("Head of ann");
    return request;
  }

  v1::PlanBuild Create() {
    v1::BuildFile file;
    EXPECT_TRUE(Send(ann_, ct_, ".nrrd", 0, &file).ok());
    v1::PlanBuild build;
    const grpc::Status status =
        stub_->CreatePlanBuild(ContextOf(ann_).get(), RequestOf(file), &build);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return build;
  }

  // All states that a watch sends, the last of which is the end.
  std::vector<v1::PlanBuild> Watch(const std::string& name) {
    const auto context = ContextOf(ann_);
    context->set_deadline(std::chrono::system_clock::now() + kMostOfABuild);
    v1::WatchPlanBuildRequest request;
    request.set_name(name);
    const auto reader = stub_->WatchPlanBuild(context.get(), request);
    std::vector<v1::PlanBuild> states;
    for (v1::PlanBuild state; reader->Read(&state);) states.push_back(state);
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return states;
  }

  std::string Read(const std::string& name, const std::string& path) {
    const auto context = ContextOf(ann_);
    v1::ReadPlanBuildFileRequest request;
    request.set_name(name);
    request.set_path(path);
    const auto reader = stub_->ReadPlanBuildFile(context.get(), request);
    std::string bytes;
    for (v1::ReadPlanBuildFileResponse part; reader->Read(&part);) {
      EXPECT_EQ(part.offset(), static_cast<int64_t>(bytes.size()));
      bytes += part.data();
    }
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok()) << path << ": " << status.error_message();
    return bytes;
  }

  v1::CreateBuildDraftRequest DraftRequest(const std::string& file,
                                           const std::string& project = "") const {
    v1::CreateBuildDraftRequest request;
    request.set_ct(file);
    request.set_title("Case 1a2b3c4d");
    request.set_project(project);
    request.set_recipe_json(kRecipe);
    return request;
  }
  v1::BuildDraft CreateDraft(const Caller& caller, const std::string& project) {
    v1::BuildFile file;
    EXPECT_TRUE(Send(caller, ct_, ".nrrd", 0, &file).ok());
    v1::BuildDraft draft;
    const grpc::Status status = stub_->CreateBuildDraft(ContextOf(caller).get(),
                                                        DraftRequest(file.name(), project), &draft);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return draft;
  }
  Code GetDraft(const Caller& caller, const std::string& name, v1::BuildDraft* draft) {
    v1::GetBuildDraftRequest request;
    request.set_name(name);
    return stub_->GetBuildDraft(ContextOf(caller).get(), request, draft).error_code();
  }
  std::vector<std::string> ListDrafts(const Caller& caller) {
    v1::ListBuildDraftsResponse response;
    EXPECT_TRUE(stub_->ListBuildDrafts(ContextOf(caller).get(), {}, &response).ok());
    std::vector<std::string> names;
    for (const v1::BuildDraft& draft : response.drafts()) {
      names.push_back(draft.name());
      EXPECT_TRUE(draft.recipe_json().empty());
    }
    return names;
  }
  Code DeleteDraft(const Caller& caller, const std::string& name) {
    v1::DeleteBuildDraftRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    return stub_->DeleteBuildDraft(ContextOf(caller).get(), request, &empty).error_code();
  }
  grpc::Status ReadDraft(const Caller& caller, const std::string& name, std::string* bytes) {
    const auto context = ContextOf(caller);
    v1::ReadBuildDraftRequest request;
    request.set_name(name);
    const auto reader = stub_->ReadBuildDraft(context.get(), request);
    for (v1::ReadBuildDraftResponse part; reader->Read(&part);) {
      EXPECT_EQ(part.offset(), static_cast<int64_t>(bytes->size()));
      *bytes += part.data();
    }
    return reader->Finish();
  }
  grpc::Status BuildOf(const Caller& caller, const v1::BuildDraft& draft, v1::PlanBuild* build) {
    v1::CreatePlanBuildRequest request;
    request.set_draft(draft.name());
    request.set_recipe_json(draft.recipe_json());
    request.set_title("Head of ann");
    return stub_->CreatePlanBuild(ContextOf(caller).get(), request, build);
  }
  void Share(const Caller& owner, const std::string& principal, v1::ShareRole role) {
    const auto access = v1::AccessService::NewStub(OwnChannel());
    v1::CreateShareRequest request;
    request.mutable_share()->set_resource("projects/p");
    request.mutable_share()->set_principal(principal);
    request.mutable_share()->set_role(role);
    v1::Share share;
    const grpc::Status status = access->CreateShare(ContextOf(owner).get(), request, &share);
    EXPECT_TRUE(status.ok()) << status.error_message();
  }

  static constexpr size_t kChunk = 100'000;
  const Caller bridge_{.name = "BRIDGE", .link = ""};
  const Caller ann_{.name = "ANN", .link = ""};
  const Caller bob_{.name = "BOB", .link = ""};
  const Caller reader_{.name = "carl", .link = ""};  // no publisher
  const std::string ct_ = OneFileOfTheCt();
  // Pictures need Xvfb and seconds, and no test here looks at them.
  const ScopedEnvironment no_display_{"PATH", "/nowhere"};
  NamedCallers callers_;
  std::unique_ptr<v1::PlanBuildService::Stub> stub_;
};

TEST_F(PlanBuildsOfServerTest, APlanIsThatOfTheCommandByteForByte) {
  Start();
  const v1::PlanBuild begun = Create();
  const std::vector<v1::PlanBuild> states = Watch(begun.name());
  ASSERT_FALSE(states.empty());
  const v1::PlanBuild& done = states.back();
  ASSERT_EQ(done.state(), v1::PLAN_BUILD_STATE_SUCCEEDED) << done.detail();
  EXPECT_TRUE(std::is_sorted(states.begin(), states.end(), [](const auto& a, const auto& b) {
    return a.fraction() < b.fraction();
  }));

  const std::filesystem::path folder = EmptyTestFolder("plan_builds_of_server");
  std::filesystem::create_directories(folder / "plan");
  std::ofstream(folder / "ct.nrrd", std::ios::binary) << ct_;
  std::ofstream(folder / "recipe.json") << kRecipe;
  ASSERT_OK_AND_ASSIGN(const PlanBuildAnswer here, CallPlanBuild({.ct = folder / "ct.nrrd",
                                                                  .recipe = folder / "recipe.json",
                                                                  .folder = folder / "plan",
                                                                  .folder_name = "plan",
                                                                  .threads = AvailableProcessors(),
                                                                  .pictures = false}));
  EXPECT_EQ(done.summary(), here.text);
  EXPECT_EQ(done.is_ready(), here.ready);
  for (const char* name : {"plan.json", "head.vtu", "report.json", "segments/mandible.stl"}) {
    EXPECT_EQ(Read(done.name(), name), BytesOfFile((folder / "plan" / name).string())) << name;
  }

  // The case is in the store, by the title that its owner gave, and what it was built from is gone.
  const auto cases = v1::CaseService::NewStub(OwnChannel());
  v1::GetCaseRequest get_case;
  get_case.set_name(done.case_());
  v1::Case kept;
  ASSERT_TRUE(cases->GetCase(ContextOf(ann_).get(), get_case, &kept).ok());
  EXPECT_EQ(kept.title(), "Head of ann");
  v1::GetBuildFileRequest get_file;
  get_file.set_name(absl::StrCat("buildFiles/", Sha256Hex({ct_})));
  v1::BuildFile file;
  EXPECT_EQ(stub_->GetBuildFile(ContextOf(ann_).get(), get_file, &file).error_code(),
            Code::NOT_FOUND);
  // No other user hears of either.
  v1::GetPlanBuildRequest get_build;
  get_build.set_name(done.name());
  v1::PlanBuild build;
  EXPECT_EQ(stub_->GetPlanBuild(ContextOf(bob_).get(), get_build, &build).error_code(),
            Code::NOT_FOUND);
}

TEST_F(PlanBuildsOfServerTest, ResumesAnInterruptedUpload) {
  Start();
  const auto context = ContextOf(ann_);
  v1::BuildFile file;
  const auto writer = stub_->UploadBuildFile(context.get(), &file);
  v1::UploadBuildFileRequest request;
  request.mutable_header()->set_sha256(Sha256Hex({ct_}));
  request.mutable_header()->set_total_bytes(static_cast<int64_t>(ct_.size()));
  request.mutable_header()->set_suffix(".nrrd");
  writer->Write(request);
  request.mutable_chunk()->set_data(ct_.substr(0, kChunk));
  writer->Write(request);
  writer->WritesDone();
  EXPECT_EQ(writer->Finish().error_code(), Code::INVALID_ARGUMENT);

  v1::GetBuildFileRequest get;
  get.set_name(absl::StrCat("buildFiles/", Sha256Hex({ct_})));
  ASSERT_TRUE(stub_->GetBuildFile(ContextOf(ann_).get(), get, &file).ok());
  EXPECT_EQ(file.committed_bytes(), static_cast<int64_t>(kChunk));
  ASSERT_TRUE(Send(ann_, ct_, ".nrrd", kChunk, &file).ok());
  EXPECT_EQ(file.committed_bytes(), static_cast<int64_t>(ct_.size()));
  // Once more costs nothing.
  ASSERT_TRUE(Send(ann_, ct_, ".nrrd", ct_.size(), &file).ok());
}

TEST_F(PlanBuildsOfServerTest, ACancelledBuildEndsItsProgram) {
  Start();
  const v1::PlanBuild begun = Create();
  const auto context = ContextOf(ann_);
  v1::WatchPlanBuildRequest watch;
  watch.set_name(begun.name());
  const auto reader = stub_->WatchPlanBuild(context.get(), watch);
  v1::PlanBuild state;
  while (reader->Read(&state) && state.stage().empty()) {
  }
  v1::CancelPlanBuildRequest cancel;
  cancel.set_name(begun.name());
  v1::PlanBuild answer;
  ASSERT_TRUE(stub_->CancelPlanBuild(ContextOf(ann_).get(), cancel, &answer).ok());
  while (reader->Read(&state)) {
  }
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(state.state(), v1::PLAN_BUILD_STATE_CANCELLED);
  EXPECT_TRUE(state.case_().empty());
}

TEST_F(PlanBuildsOfServerTest, AFailureIsOneSentenceWithoutAPathOfTheServer) {
  Start({.max_memory_bytes = int64_t{150} << 20});
#if !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)  // which need terabytes of addresses
  const v1::PlanBuild without_memory = Watch(Create().name()).back();
  EXPECT_EQ(without_memory.state(), v1::PLAN_BUILD_STATE_FAILED);
  EXPECT_THAT(without_memory.detail(), HasSubstr("bytes of memory"));
#endif

  v1::BuildFile file;
  ASSERT_TRUE(Send(ann_, "this is no volume", ".nrrd", 0, &file).ok());
  v1::PlanBuild build;
  ASSERT_TRUE(stub_->CreatePlanBuild(ContextOf(ann_).get(), RequestOf(file), &build).ok());
  const v1::PlanBuild no_volume = Watch(build.name()).back();
  EXPECT_EQ(no_volume.state(), v1::PLAN_BUILD_STATE_FAILED);
  EXPECT_THAT(no_volume.detail(), HasSubstr("does not begin like one"));
  EXPECT_THAT(no_volume.detail(), Not(HasSubstr("/")));
}

TEST_F(PlanBuildsOfServerTest, RefusesInvalidRequests) {
  Start();
  v1::BuildFile file;
  EXPECT_EQ(Send(reader_, ct_, ".nrrd", 0, &file).error_code(), Code::PERMISSION_DENIED);
  EXPECT_EQ(Send(ann_, ct_, ".dcm", 0, &file).error_code(), Code::INVALID_ARGUMENT);
  ASSERT_TRUE(Send(ann_, ct_, ".nrrd", 0, &file).ok());
  const auto code = [this](const v1::CreatePlanBuildRequest& request) {
    v1::PlanBuild build;
    return stub_->CreatePlanBuild(ContextOf(ann_).get(), request, &build).error_code();
  };
  v1::CreatePlanBuildRequest request = RequestOf(file);
  request.set_ct(absl::StrCat("buildFiles/", std::string(64, '0')));
  EXPECT_EQ(code(request), Code::NOT_FOUND);
  request = RequestOf(file);
  request.clear_recipe_json();
  EXPECT_EQ(code(request), Code::INVALID_ARGUMENT);
  for (const char* path : {"../etc/passwd", "/etc/passwd", "a//b", "", "recipe.json", "ü.stl"}) {
    request = RequestOf(file);
    v1::RecipeFile& named = *request.add_recipe_files();
    named.set_path(path);
    named.set_file(file.name());
    EXPECT_EQ(code(request), Code::INVALID_ARGUMENT) << path;
  }
}

TEST_F(PlanBuildsOfServerTest, ADraftBelongsToItsOwnerAndThoseOfItsProject) {
  Start();
  const v1::BuildDraft draft = CreateDraft(bridge_, "p");
  v1::BuildDraft found;
  std::string bytes;
  for (const Caller& stranger : {ann_, reader_}) {
    EXPECT_EQ(GetDraft(stranger, draft.name(), &found), Code::NOT_FOUND);
    EXPECT_EQ(ReadDraft(stranger, draft.name(), &bytes).error_code(), Code::NOT_FOUND);
    EXPECT_EQ(DeleteDraft(stranger, draft.name()), Code::NOT_FOUND);
    EXPECT_TRUE(ListDrafts(stranger).empty());
  }
  EXPECT_TRUE(bytes.empty());
  v1::PlanBuild build;
  EXPECT_EQ(BuildOf(ann_, draft, &build).error_code(), Code::NOT_FOUND);

  // A project of this name that is another's opens nothing.
  Share(bob_, ann_.name, v1::SHARE_ROLE_PLANNER);
  EXPECT_EQ(GetDraft(ann_, draft.name(), &found), Code::NOT_FOUND);

  Share(bridge_, ann_.name, v1::SHARE_ROLE_VIEWER);
  EXPECT_EQ(GetDraft(ann_, draft.name(), &found), Code::OK);
  EXPECT_EQ(found.recipe_json(), kRecipe);
  EXPECT_THAT(ListDrafts(ann_), ::testing::ElementsAre(draft.name()));
  EXPECT_TRUE(ReadDraft(ann_, draft.name(), &bytes).ok());
  EXPECT_EQ(bytes, ct_);
  EXPECT_EQ(DeleteDraft(ann_, draft.name()), Code::PERMISSION_DENIED);
  EXPECT_EQ(BuildOf(ann_, draft, &build).error_code(), Code::PERMISSION_DENIED);

  Share(bridge_, ann_.name, v1::SHARE_ROLE_PLANNER);
  EXPECT_EQ(DeleteDraft(ann_, draft.name()), Code::OK);
  EXPECT_EQ(GetDraft(bridge_, draft.name(), &found), Code::NOT_FOUND);
  // Only its owner hears of a draft without a project.
  const v1::BuildDraft alone = CreateDraft(bridge_, "");
  EXPECT_EQ(GetDraft(ann_, alone.name(), &found), Code::NOT_FOUND);
  EXPECT_THAT(ListDrafts(bridge_), ::testing::ElementsAre(alone.name()));
}

TEST_F(PlanBuildsOfServerTest, APlannersBuildOfADraftReportsItsCaseToTheBridge) {
  Start();
  Share(bridge_, ann_.name, v1::SHARE_ROLE_PLANNER);
  v1::BuildDraft draft = CreateDraft(bridge_, "p");
  ASSERT_EQ(GetDraft(ann_, draft.name(), &draft), Code::OK);
  v1::PlanBuild build;
  const grpc::Status begun = BuildOf(ann_, draft, &build);
  ASSERT_TRUE(begun.ok()) << begun.error_message();
  EXPECT_EQ(DeleteDraft(bridge_, draft.name()), Code::FAILED_PRECONDITION);
  const v1::PlanBuild done = Watch(build.name()).back();
  ASSERT_EQ(done.state(), v1::PLAN_BUILD_STATE_SUCCEEDED) << done.detail();
  ASSERT_EQ(GetDraft(bridge_, draft.name(), &draft), Code::OK);
  EXPECT_THAT(draft.cases(), ::testing::ElementsAre(done.case_()));
}

TEST_F(PlanBuildsOfServerTest, RefusesInvalidDrafts) {
  Start();
  v1::BuildFile file;
  ASSERT_TRUE(Send(ann_, ct_, ".nrrd", 0, &file).ok());
  v1::BuildDraft draft;
  const auto code = [&](const Caller& caller, const v1::CreateBuildDraftRequest& request) {
    return stub_->CreateBuildDraft(ContextOf(caller).get(), request, &draft).error_code();
  };
  EXPECT_EQ(code(reader_, DraftRequest(file.name())), Code::PERMISSION_DENIED);
  EXPECT_EQ(code(bob_, DraftRequest(file.name())), Code::NOT_FOUND) << "another's file";
  EXPECT_EQ(code(ann_, DraftRequest("ct.nrrd")), Code::INVALID_ARGUMENT);
  EXPECT_EQ(code(ann_, DraftRequest(file.name(), "of others")), Code::PERMISSION_DENIED);
  v1::CreateBuildDraftRequest request = DraftRequest(file.name());
  request.set_title(std::string(257, 'x'));
  EXPECT_EQ(code(ann_, request), Code::INVALID_ARGUMENT);
  request = DraftRequest(file.name());
  request.set_recipe_json(std::string((1 << 20) + 1, ' '));
  EXPECT_EQ(code(ann_, request), Code::INVALID_ARGUMENT);
  for (const char* name : {"", "buildDrafts/", "buildDrafts/../x", "planBuilds/1"}) {
    EXPECT_EQ(GetDraft(ann_, name, &draft), Code::INVALID_ARGUMENT) << name;
  }
  // A draft has its own CT.
  ASSERT_EQ(code(ann_, DraftRequest(file.name())), Code::OK);
  v1::CreatePlanBuildRequest both = RequestOf(file);
  both.set_draft(draft.name());
  v1::PlanBuild build;
  EXPECT_EQ(stub_->CreatePlanBuild(ContextOf(ann_).get(), both, &build).error_code(),
            Code::INVALID_ARGUMENT);
}

TEST_F(PlanBuildsOfServerTest, ServerWithoutPlanBuildsSaysSo) {
  Start({.at_once = 0});
  v1::BuildFile file;
  EXPECT_EQ(Send(ann_, ct_, ".nrrd", 0, &file).error_code(), Code::FAILED_PRECONDITION);
  v1::ListPlanBuildsResponse list;
  const grpc::Status status = stub_->ListPlanBuilds(ContextOf(ann_).get(), {}, &list);
  EXPECT_EQ(status.error_code(), Code::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("--plan-builds"));
  std::string bytes;
  EXPECT_EQ(ReadDraft(ann_, "buildDrafts/1", &bytes).error_code(), Code::FAILED_PRECONDITION);
}

}  // namespace
}  // namespace tissueform::testing
