// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "spdlog/spdlog.h"

#include "core/mesh/payload/sha256.h"
#include "tests/integration/access_calls.h"
#include "tests/integration/access_world.h"
#include "tests/integration/service_test.h"

// Two tenants, a user with shares, and follow links call all rpcs with names that are
// their own, another's, shared, gone or invented. The server must answer as AccessWorld says: in
// TISSUEFORM_ACCESS_CALLS calls (5,000 when that is not set) callers without access get no answer.
namespace tissueform::testing {
namespace {

using Caller = AccessWorld::Caller;
using Kind = AccessWorld::Kind;
using Code = grpc::StatusCode;
using ::testing::ElementsAreArray;

constexpr int kCallsOfCi = 5'000;
constexpr int kCallsBetweenRestarts = 2'500;
constexpr size_t kMaxSessions = 16;
constexpr size_t kMaxPredictions = 40;

int CallsToMake() {
  const char* wanted = std::getenv("TISSUEFORM_ACCESS_CALLS");
  int calls = kCallsOfCi;
  return wanted != nullptr && absl::SimpleAtoi(wanted, &calls) ? calls : kCallsOfCi;
}

class AccessPropertyTest : public ServiceTest {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    spdlog::set_level(spdlog::level::off);
    options_ = TestOptions();
    options_.in_memory = false;
    options_.quotas = {.calls_per_second = 1'000'000, .streams = 1'000};
    options_.data_dir = folder_ + "/data";
    Restart();
    for (uint32_t seed = 1; seed <= 4; ++seed) meshes_.emplace_back(seed);
    for (int i = 0; i < 4; ++i) cases_.push_back(absl::StrCat("the bytes of case ", i));
  }
  void TearDown() override {
    StopServer();
    std::filesystem::remove_all(folder_);
  }

  void Restart() {
    stubs_.reset();
    StopServer();
    StartServer(options_, &callers_);
    stubs_ = std::make_unique<Stubs>(OwnChannel());
  }

  size_t Below(size_t end) { return std::uniform_int_distribution<size_t>(0, end - 1)(random_); }
  bool OneIn(size_t n) { return Below(n) == 0; }
  template <typename Items>
  const auto& Any(const Items& items) {
    return *std::next(items.begin(), static_cast<std::ptrdiff_t>(Below(items.size())));
  }

  // "ANN", "BOB" and "BRIDGE" publish; "vic" and "bob-2" do not.
  Caller AnyCaller() {
    if (OneIn(5) && !links_.empty()) {
      return {.name = "link", .link = OneIn(8) ? "tfl_" + std::string(43, 'x') : Any(links_)};
    }
    return {.name = Any(std::vector<std::string>{"ANN", "ANN", "BOB", "BOB", "vic", "BRIDGE"}),
            .link = ""};
  }
  Caller AnyPrincipal() {
    Caller caller = AnyCaller();
    while (!caller.link.empty()) caller = AnyCaller();
    return caller;
  }
  std::string Invented(Kind kind) {
    std::string digits;
    const size_t count = kind == Kind::kSession || kind == Kind::kPrediction ? 32 : 64;
    for (size_t i = 0; i < count; ++i) digits += "0123456789abcdef"[Below(16)];
    if (kind == Kind::kExport)
      return PrefixOf(kind) + digits.substr(0, 12) + "-" + digits.substr(32);
    return PrefixOf(kind) + digits;
  }
  static std::string PrefixOf(Kind kind) {
    return std::map<Kind, std::string>{{Kind::kSession, "sessions/"},
                                       {Kind::kPrediction, "predictions/"},
                                       {Kind::kCase, "cases/"},
                                       {Kind::kExport, "exports/"},
                                       {Kind::kMesh, "meshes/"}}
        .at(kind);
  }
  // One that there is or has been, or an invented one.
  std::string AnyName(Kind kind) {
    std::vector<std::string> names;
    if (kind == Kind::kSession) names = session_names_;
    if (kind == Kind::kPrediction) names = prediction_names_;
    if (kind == Kind::kExport) names = export_names_;
    if (kind == Kind::kCase) {
      for (const std::string& bytes : cases_) names.push_back(NameOfCase(bytes));
    }
    if (kind == Kind::kMesh) {
      for (const SentMesh& mesh : meshes_) names.push_back(mesh.name);
    }
    return names.empty() || OneIn(10) ? Invented(kind) : Any(names);
  }
  static std::string NameOfCase(const std::string& bytes) { return "cases/" + Sha256Hex({bytes}); }
  static void Remember(std::vector<std::string>* names, const std::string& name) {
    names->push_back(name);
    if (names->size() > 30) names->erase(names->begin());
  }

  // What a call must end with before anything else is said of it; OK: it is served.
  Code Expected(const Caller& caller, Kind kind, const std::string& name, AccessWorld::Level need,
                bool open_to_links) const {
    if (!caller.link.empty()) {
      if (!world_.IsGood(caller.link)) return Code::UNAUTHENTICATED;
      if (!open_to_links) return Code::PERMISSION_DENIED;
    }
    const AccessWorld::Level level = world_.Of(caller, kind, name);
    if (level == AccessWorld::kNothing) return Code::NOT_FOUND;
    return level < need ? Code::PERMISSION_DENIED : Code::OK;
  }
  static bool IsRefusal(Code code) {
    return code == Code::UNAUTHENTICATED || code == Code::PERMISSION_DENIED ||
           code == Code::NOT_FOUND;
  }
  // The answer is that of `expected`, where served ones may also end with `others`.
  void Check(const std::string& what, const Caller& caller, const std::string& name,
             const Answer& answer, Code expected, const std::vector<Code>& others = {}) {
    ++calls_;
    const Code code = answer.status.error_code();
    const bool as_expected = code == expected || (expected == Code::OK &&
                                                  std::ranges::find(others, code) != others.end());
    EXPECT_TRUE(as_expected) << what << " of " << name << " by " << caller.name << caller.link
                             << ": " << code << " instead of " << expected << ": "
                             << answer.status.error_message();
    if (IsRefusal(expected)) {
      EXPECT_EQ(answer.messages, "") << what;
    }
  }

  void LookAtSomething() {
    const NamedCall& call = Any(NamedCalls());
    const Caller caller = AnyCaller();
    const std::string name = AnyName(call.kind);
    const Answer answer = call.call(*stubs_, ContextOf(caller).get(), name);
    const Code expected = Expected(caller, call.kind, name, call.need, call.open_to_links);
    std::vector<Code> others;
    if (call.rpc == "UpdateSession") others = {Code::ABORTED};
    if (call.rpc == "Fit") others = {Code::INVALID_ARGUMENT};
    if (call.rpc == "Watch") others = {Code::RESOURCE_EXHAUSTED};
    Check(call.rpc, caller, name, answer, expected, others);
    if (expected == Code::NOT_FOUND) ExpectSameOfInvented(call, caller, name, answer);
  }

  // To the last byte, but for the name.
  void ExpectSameOfInvented(const NamedCall& call, const Caller& caller, const std::string& name,
                            const Answer& answer) {
    const std::string other = Invented(call.kind);
    const Answer of_other = call.call(*stubs_, ContextOf(caller).get(), other);
    ++calls_;
    const auto with_name = [&](const std::string& text) {
      const size_t prefix = PrefixOf(call.kind).size();
      return absl::StrReplaceAll(text, {{other.substr(prefix), name.substr(prefix)}});
    };
    EXPECT_EQ(of_other.status.error_code(), answer.status.error_code()) << call.rpc;
    EXPECT_EQ(with_name(of_other.status.error_message()), answer.status.error_message())
        << call.rpc;
    EXPECT_EQ(with_name(of_other.status.error_details()), answer.status.error_details())
        << call.rpc;
  }

  void ListSomething() {
    const Kind kind = Any(std::vector<Kind>{Kind::kSession, Kind::kPrediction, Kind::kCase,
                                            Kind::kMesh, Kind::kExport});
    const Caller caller = AnyCaller();
    std::vector<std::string> names;
    const Answer answer = ListNames(*stubs_, caller, kind, &names);
    Code expected = Code::OK;
    if (!caller.link.empty()) {
      expected = world_.IsGood(caller.link) ? Code::PERMISSION_DENIED : Code::UNAUTHENTICATED;
    }
    Check("a list", caller, PrefixOf(kind), answer, expected);
    if (expected == Code::OK) {
      EXPECT_THAT(names, ElementsAreArray(world_.Listed(caller, kind)))
          << PrefixOf(kind) << " of " << caller.name;
    }
  }

  void UploadMesh() {
    const SentMesh& mesh = Any(meshes_);
    const Caller caller = AnyCaller();
    v1::UploadMeshResponse response;
    const Answer answer = SendMesh(*stubs_, caller, mesh, &response);
    Code expected = Code::OK;
    if (!caller.link.empty()) {
      expected = world_.IsGood(caller.link) ? Code::PERMISSION_DENIED : Code::UNAUTHENTICATED;
    }
    Check("UploadMesh", caller, mesh.name, answer, expected);
    if (expected != Code::OK) return;
    const bool known = world_.Of(caller, Kind::kMesh, mesh.name) != AccessWorld::kNothing;
    EXPECT_EQ(response.already_existed(), known) << mesh.name << " by " << caller.name;
    world_.meshes.insert(mesh.name);
    if (!known) world_.senders.insert({mesh.name, caller.name});
  }

  void QueryUpload() {
    const Caller caller = AnyPrincipal();
    v1::QueryUploadRequest request;
    request.set_name(AnyName(Kind::kMesh));
    v1::QueryUploadResponse response;
    const grpc::Status status =
        stubs_->meshes->QueryUpload(ContextOf(caller).get(), request, &response);
    Check("QueryUpload", caller, request.name(), {status, response.SerializeAsString()},
          Code::NOT_FOUND);
  }

  void UploadCase() {
    const std::string& bytes = Any(cases_);
    const Caller caller = AnyCaller();
    const std::string project = OneIn(2) ? "p" : "";
    v1::UploadCaseResponse response;
    const Answer answer = SendCase(*stubs_, caller, bytes, project, &response);
    Code expected = caller.name == "vic" ? Code::PERMISSION_DENIED : Code::OK;
    if (!caller.link.empty()) {
      expected = world_.IsGood(caller.link) ? Code::PERMISSION_DENIED : Code::UNAUTHENTICATED;
    }
    Check("UploadCase", caller, NameOfCase(bytes), answer, expected);
    if (expected != Code::OK) return;
    const std::pair<std::string, std::string> key = {NameOfCase(bytes), caller.name};
    EXPECT_EQ(response.already_existed(), world_.cases.contains(key));
    EXPECT_EQ(response.case_().title(), "of " + caller.name) << "another's title";
    world_.cases.insert({key, project});
  }

  void CreateSession() {
    if (world_.sessions.size() >= kMaxSessions) return DeleteSession();
    const Caller caller = AnyCaller();
    const bool invented = OneIn(10);
    const SentMesh& mesh = Any(meshes_);
    const std::string name = invented ? Invented(Kind::kMesh) : mesh.name;
    v1::CreateSessionRequest request = ToProto(mesh.problem.Request(name));
    request.set_project(OneIn(2) ? "p" : "");
    // The same ids for all principals: each principal has its own requests.
    request.set_request_id(absl::StrCat("request-", Below(3)));
    request.clear_session_id();
    v1::Session session;
    const grpc::Status status =
        stubs_->sessions->CreateSession(ContextOf(caller).get(), request, &session);
    const Code expected = Expected(caller, Kind::kMesh, name, AccessWorld::kLook, false);
    Check("CreateSession", caller, name, {status, session.SerializeAsString()}, expected,
          {Code::INVALID_ARGUMENT});
    if (!status.ok()) return;
    const auto known = world_.sessions.find(session.name());
    if (known != world_.sessions.end()) {
      EXPECT_EQ(known->second.owner, caller.name) << "another's request id";
      return;
    }
    world_.sessions[session.name()] = {caller.name, request.project(), name};
    Remember(&session_names_, session.name());
  }

  void CreatePrediction() {
    if (world_.predictions.size() >= kMaxPredictions) return DeletePrediction();
    const Caller caller = AnyCaller();
    v1::CreatePredictionRequest request;
    request.set_session(AnyName(Kind::kSession));
    request.add_poses()->set_handle("top");
    if (!OneIn(4)) request.set_case_(AnyName(Kind::kCase));
    v1::Prediction prediction;
    const grpc::Status status =
        stubs_->predictions->CreatePrediction(ContextOf(caller).get(), request, &prediction);
    const Code expected =
        Expected(caller, Kind::kSession, request.session(), AccessWorld::kDrag, false);
    Check("CreatePrediction", caller, request.session(), {status, prediction.SerializeAsString()},
          expected);
    if (!status.ok()) return;
    world_.predictions[prediction.name()] = {caller.name, request.session(),
                                             world_.sessions.at(request.session()).mesh,
                                             request.case_()};
    Remember(&prediction_names_, prediction.name());
  }

  template <typename Request, typename Call>
  Code Delete(const std::string& what, const Caller& caller, Kind kind, const std::string& name,
              Call call, const std::vector<Code>& others = {}) {
    Request request;
    request.set_name(name);
    google::protobuf::Empty response;
    const grpc::Status status = call(ContextOf(caller).get(), request, &response);
    Check(what, caller, name, {status, ""}, Expected(caller, kind, name, AccessWorld::kOwn, false),
          others);
    return status.error_code();
  }
  void DeleteSession() {
    const Caller caller = AnyCaller();
    const std::string name = AnyName(Kind::kSession);
    const Code code = Delete<v1::DeleteSessionRequest>(
        "DeleteSession", caller, Kind::kSession, name, [&](auto* context, auto& request, auto* to) {
          return stubs_->sessions->DeleteSession(context, request, to);
        });
    if (code == Code::OK) world_.DeleteSession(name);
  }
  void DeletePrediction() {
    const Caller caller = AnyCaller();
    const std::string name = AnyName(Kind::kPrediction);
    const Code code = Delete<v1::DeletePredictionRequest>(
        "DeletePrediction", caller, Kind::kPrediction, name,
        [&](auto* context, auto& request, auto* to) {
          return stubs_->predictions->DeletePrediction(context, request, to);
        });
    if (code == Code::OK) world_.DeletePrediction(name);
  }
  void CreateExport() {
    const Caller caller = AnyCaller();
    v1::CreateExportRequest request;
    request.set_prediction(AnyName(Kind::kPrediction));
    v1::Export made;
    const grpc::Status status =
        stubs_->exports->CreateExport(ContextOf(caller).get(), request, &made);
    Code expected =
        Expected(caller, Kind::kPrediction, request.prediction(), AccessWorld::kOwn, false);
    if (expected == Code::OK && world_.predictions.at(request.prediction()).case_name.empty()) {
      expected = Code::FAILED_PRECONDITION;
    }
    Check("CreateExport", caller, request.prediction(), {status, made.SerializeAsString()},
          expected);
    if (!status.ok()) return;
    world_.exports[made.name()] = request.prediction();
    Remember(&export_names_, made.name());
  }
  void UpdateExport() {
    const Caller caller = AnyCaller();
    v1::UpdateExportRequest request;
    request.set_name(AnyName(Kind::kExport));
    request.set_state(OneIn(2) ? v1::EXPORT_STATE_STORED : v1::EXPORT_STATE_STORING);
    v1::Export changed;
    const grpc::Status status =
        stubs_->exports->UpdateExport(ContextOf(caller).get(), request, &changed);
    Code expected = Expected(caller, Kind::kExport, request.name(), AccessWorld::kLook, false);
    if (caller.link.empty() && !AccessWorld::IsBridge(caller)) expected = Code::PERMISSION_DENIED;
    Check("UpdateExport", caller, request.name(), {status, changed.SerializeAsString()}, expected,
          {Code::INVALID_ARGUMENT});
  }
  // What there is at the beginning.
  void WatchExports() {
    const Caller caller = AnyCaller();
    const auto context = ContextOf(caller);
    const auto watch = stubs_->exports->WatchExports(context.get(), {});
    Answer answer;
    v1::WatchExportsResponse message;
    bool began = false;
    while (watch->Read(&message)) {
      began = true;
      if (!message.has_export_()) break;
      EXPECT_NE(world_.Of(caller, Kind::kExport, message.export_().name()), AccessWorld::kNothing)
          << message.export_().name() << " to " << caller.name;
    }
    if (began) context->TryCancel();
    answer.status = watch->Finish();
    if (began) answer.status = grpc::Status::OK;
    Code expected = Code::OK;
    if (!caller.link.empty()) {
      expected = world_.IsGood(caller.link) ? Code::PERMISSION_DENIED : Code::UNAUTHENTICATED;
    }
    Check("WatchExports", caller, "exports/", answer, expected, {Code::RESOURCE_EXHAUSTED});
  }
  void DeleteExport() {
    const Caller caller = AnyCaller();
    const std::string name = AnyName(Kind::kExport);
    const Code code = Delete<v1::DeleteExportRequest>(
        "DeleteExport", caller, Kind::kExport, name, [&](auto* context, auto& request, auto* to) {
          return stubs_->exports->DeleteExport(context, request, to);
        });
    if (code == Code::OK) world_.exports.erase(name);
  }
  void DeleteCase() {
    const Caller caller = AnyCaller();
    const std::string name = AnyName(Kind::kCase);
    const Code code = Delete<v1::DeleteCaseRequest>(
        "DeleteCase", caller, Kind::kCase, name, [&](auto* context, auto& request, auto* to) {
          return stubs_->cases->DeleteCase(context, request, to);
        });
    if (code == Code::OK) world_.DeleteCase(name, caller.name);
  }
  void DeleteMesh() {
    const Caller caller = AnyCaller();
    const std::string name = AnyName(Kind::kMesh);
    const bool in_use = caller.link.empty() && world_.SessionsOf(caller.name, name) > 0;
    const Code code =
        Delete<v1::DeleteMeshRequest>("DeleteMesh", caller, Kind::kMesh, name,
                                      [&](auto* context, auto& request, auto* to) {
                                        return stubs_->meshes->DeleteMesh(context, request, to);
                                      },
                                      {Code::FAILED_PRECONDITION});
    if (code == Code::FAILED_PRECONDITION) {
      EXPECT_TRUE(in_use) << "by another's sessions: " << name;
    }
    if (code == Code::OK) {
      EXPECT_FALSE(in_use) << name;
      world_.DeleteMesh(caller, name);
    }
  }

  std::string AnyShared(Kind* kind) {
    *kind = Any(std::vector<Kind>{Kind::kSession, Kind::kSession, Kind::kPrediction, Kind::kCase});
    return AnyName(*kind);
  }
  void CreateShare() {
    const Caller caller = AnyCaller();
    Kind kind = Kind::kSession;
    const bool of_project = OneIn(8);
    v1::CreateShareRequest request;
    v1::Share* share = request.mutable_share();
    share->set_resource(of_project ? "projects/p" : AnyShared(&kind));
    share->set_principal(Any(std::vector<std::string>{"ANN", "BOB", "vic", "vic"}));
    share->set_role(OneIn(2) ? v1::SHARE_ROLE_VIEWER : v1::SHARE_ROLE_PLANNER);
    v1::Share response;
    const grpc::Status status =
        stubs_->access->CreateShare(ContextOf(caller).get(), request, &response);
    Code expected = Expected(caller, kind, share->resource(), AccessWorld::kOwn, false);
    if (of_project && caller.link.empty()) expected = Code::OK;
    Check("CreateShare", caller, share->resource(), {status, ""}, expected);
    if (!status.ok()) return;
    world_.shares[{caller.name, share->resource(), share->principal()}] =
        share->role() == v1::SHARE_ROLE_PLANNER ? AccessWorld::kDrag : AccessWorld::kLook;
  }
  void DeleteShare() {
    const Caller caller = AnyCaller();
    Kind kind = Kind::kSession;
    v1::DeleteShareRequest request;
    const bool of_project = OneIn(8);
    request.set_resource(of_project ? "projects/p" : AnyShared(&kind));
    request.set_principal(Any(std::vector<std::string>{"ANN", "BOB", "vic"}));
    if (OneIn(2) && !world_.shares.empty()) {
      const auto& [key, level] = Any(world_.shares);
      request.set_resource(std::get<1>(key));
      request.set_principal(std::get<2>(key));
    }
    google::protobuf::Empty response;
    const grpc::Status status =
        stubs_->access->DeleteShare(ContextOf(caller).get(), request, &response);
    const bool there = caller.link.empty() && world_.shares.erase({caller.name, request.resource(),
                                                                   request.principal()}) > 0;
    if (there) {
      Check("DeleteShare", caller, request.resource(), {status, ""}, Code::OK);
    } else {
      ++calls_;
      EXPECT_TRUE(IsRefusal(status.error_code())) << request.resource();
    }
  }

  void CreateLink() {
    const Caller caller = AnyCaller();
    v1::CreateFollowLinkRequest request;
    request.set_session(AnyName(Kind::kSession));
    if (OneIn(2)) request.set_case_(AnyName(Kind::kCase));
    v1::FollowLink link;
    const grpc::Status status =
        stubs_->access->CreateFollowLink(ContextOf(caller).get(), request, &link);
    Code expected = Expected(caller, Kind::kSession, request.session(), AccessWorld::kDrag, false);
    if (expected == Code::OK && !request.case_().empty()) {
      expected = Expected(caller, Kind::kCase, request.case_(), AccessWorld::kLook, false);
    }
    Check("CreateFollowLink", caller, request.session(), {status, link.SerializeAsString()},
          expected, {Code::RESOURCE_EXHAUSTED});
    if (!status.ok()) return;
    world_.links[link.token()] = {request.session(), caller.name, request.case_()};
    Remember(&links_, link.token());
  }
  void DeleteLinks() {
    const Caller caller = AnyCaller();
    v1::DeleteFollowLinksRequest request;
    request.set_session(AnyName(Kind::kSession));
    google::protobuf::Empty response;
    const grpc::Status status =
        stubs_->access->DeleteFollowLinks(ContextOf(caller).get(), request, &response);
    Check("DeleteFollowLinks", caller, request.session(), {status, ""},
          Expected(caller, Kind::kSession, request.session(), AccessWorld::kDrag, false));
    if (!status.ok()) return;
    std::erase_if(world_.links,
                  [&](const auto& link) { return link.second.session == request.session(); });
  }

  void AcknowledgeNothing() {
    const Caller caller = AnyCaller();
    v1::AcknowledgeWatchRequest request;
    request.set_watch("watches/" + Invented(Kind::kMesh).substr(0, 39).substr(7));
    google::protobuf::Empty response;
    const grpc::Status status =
        stubs_->deform->AcknowledgeWatch(ContextOf(caller).get(), request, &response);
    const bool good = caller.link.empty() || world_.IsGood(caller.link);
    Check("AcknowledgeWatch", caller, request.watch(), {status, ""},
          good ? Code::NOT_FOUND : Code::UNAUTHENTICATED);
  }

  void AskAboutOneself() {
    const Caller caller = AnyCaller();
    const bool good = caller.link.empty() || world_.IsGood(caller.link);
    v1::Caller reported;
    const grpc::Status status = stubs_->access->WhoAmI(ContextOf(caller).get(), {}, &reported);
    Check("WhoAmI", caller, "", {status, reported.SerializeAsString()},
          good ? Code::OK : Code::UNAUTHENTICATED);
    if (caller.link.empty()) {
      EXPECT_EQ(reported.principal(), caller.name);
    }
    v1::ServerInfo info;
    const grpc::Status of_info = stubs_->info->GetServerInfo(ContextOf(caller).get(), {}, &info);
    Check("GetServerInfo", caller, "", {of_info, ""}, good ? Code::OK : Code::UNAUTHENTICATED);
    if (!caller.link.empty()) return;
    v1::GetUsageRequest request;
    request.set_principal(OneIn(2) ? "" : "-");
    v1::Usage usage;
    const grpc::Status of_usage =
        stubs_->access->GetUsage(ContextOf(caller).get(), request, &usage);
    Check("GetUsage", caller, "", {of_usage, usage.SerializeAsString()},
          request.principal().empty() ? Code::OK : Code::PERMISSION_DENIED);
    if (of_usage.ok()) {
      ASSERT_EQ(usage.principals_size(), 1);
      EXPECT_EQ(usage.principals(0).principal(), caller.name);
    }
  }

  void Act() {
    const size_t choice = Below(107);
    if (choice < 42) return LookAtSomething();
    if (choice < 50) return ListSomething();
    if (choice < 57) return UploadMesh();
    if (choice < 59) return QueryUpload();
    if (choice < 64) return UploadCase();
    if (choice < 71) return CreateSession();
    if (choice < 76) return CreatePrediction();
    if (choice < 79) return DeleteSession();
    if (choice < 81) return DeletePrediction();
    if (choice < 83) return DeleteCase();
    if (choice < 85) return DeleteMesh();
    if (choice < 90) return CreateShare();
    if (choice < 93) return DeleteShare();
    if (choice < 96) return CreateLink();
    if (choice < 97) return DeleteLinks();
    if (choice < 98) return AcknowledgeNothing();
    if (choice < 100) return AskAboutOneself();
    if (choice < 103) return CreateExport();
    if (choice < 105) return UpdateExport();
    if (choice < 106) return WatchExports();
    DeleteExport();
  }

  NamedCallers callers_;
  std::string folder_ = ::testing::TempDir() + "tenants-XXXXXX";
  ServerOptions options_;
  std::unique_ptr<Stubs> stubs_;
  std::mt19937 random_{20261123};
  std::vector<SentMesh> meshes_;
  std::vector<std::string> cases_;  // their bytes
  AccessWorld world_;
  std::vector<std::string> session_names_;
  std::vector<std::string> prediction_names_;
  std::vector<std::string> links_;
  std::vector<std::string> export_names_;
  int calls_ = 0;
};

TEST_F(AccessPropertyTest, RandomCallsNeverRevealUnauthorizedData) {
  const int calls = CallsToMake();
  for (int restart_at = kCallsBetweenRestarts; calls_ < calls && !HasFailure();) {
    Act();
    if (calls_ >= restart_at) {
      Restart();
      restart_at += kCallsBetweenRestarts;
    }
  }
  RecordProperty("calls", calls_);
}

}  // namespace
}  // namespace tissueform::testing
