// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/plan_session.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/problem/contact_summary.h"
#include "proto/conversion/contact_conversion.h"
#include "proto/conversion/material_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/service_test.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"

// Sessions whose tissue slides and lifts off, over the network and through a restart.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr char kArray[] = "youngs_modulus_pa";

class ContactSessionsTest : public ServiceTest {
 protected:
  // Down, so that the lips press; up, so that they part; and both with a turn.
  static std::vector<HandlePose> Poses() {
    std::vector<HandlePose> poses(6);
    for (size_t i = 0; i < poses.size(); ++i) {
      poses[i].translation_mm = {0.05, -0.1,
                                 (i % 2 == 0 ? -0.1 : 0.1) * static_cast<double>(i + 1)};
      poses[i].rotation_vector.x() = 0.02 * static_cast<double>(i % 3);
    }
    return poses;
  }

  PlanProblem Problem(const std::vector<ContactRow>& rows) const {
    PlanProblem problem{
        .mesh = std::make_shared<const TetMesh>(block_.mesh),
        .point_data = {},
        .cell_data = {},
        .written_in = CoordinateSystem::kLps,
        .stiffness = Eigen::VectorXd::Constant(block_.mesh.num_tets(), 9000),
        .constraints = *ConstraintSet::Create(block_.mesh, block_.Constraints().fixed(),
                                              {{"top", PartedBlock::Top()}}, rows),
        .poses = {HandlePose{}},
        .deformer = {},
        .uncertainty = {}};
    problem.deformer.model = DeformationModel::kLinearElastic;
    return problem;
  }

  // With the seal of the lips, or with an edge that could be sealed.
  PlanProblem SealProblem(bool sealed) const {
    PlanProblem problem = Problem(block_.rows);
    problem.lip_edge = block_.Edge();
    if (sealed) problem.deformer.seal = problem.lip_edge;
    return problem;
  }

  static Deformation Solve(const PlanProblem& problem, const HandlePose& pose) {
    const auto deformer =
        CreateDeformer(*problem.mesh, problem.stiffness, problem.constraints, problem.deformer);
    EXPECT_THAT(deformer, IsOk());
    return *(*deformer)->Deform({pose});
  }

  static std::string Float32Bytes(const Positions& positions) {
    const FloatPositions rounded = positions.cast<float>();
    return {reinterpret_cast<const char*>(rounded.data()),
            static_cast<size_t>(rounded.size()) * sizeof(float)};
  }

  static v1::Session MakeContactSession(TissueformClient* client, const PlanProblem& problem,
                                        const std::string& id = "") {
    const auto mesh = client->UploadMesh(*problem.mesh, {{kArray, problem.stiffness}});
    EXPECT_THAT(mesh, IsOk());
    SessionRequest request = SessionRequestOf(problem, mesh->name());
    request.session_id = id;
    const auto session = client->CreateSession(request);
    EXPECT_THAT(session, IsOk());
    return *session;
  }

  static std::string Answer(TissueformClient* client, const v1::Session& session,
                            const HandlePose& pose) {
    const auto answer = client->DeformOnce(session.name(), TopPose(pose));
    EXPECT_THAT(answer, IsOk());
    return answer->positions();
  }

  // The frames of a drag through all poses.
  static std::vector<std::string> Drag(TissueformClient* client, const v1::Session& session,
                                       const DeformStream::Options& options = {}) {
    std::vector<std::string> frames;
    const auto stream = client->OpenStream(session.name(), options);
    EXPECT_THAT(stream, IsOk());
    for (const HandlePose& pose : Poses()) {
      EXPECT_THAT((*stream)->SendPoses(frames.size() + 1, TopPose(pose)), IsOk());
      std::optional<v1::DeformFrame> frame = (*stream)->Receive();
      EXPECT_TRUE(frame.has_value());
      EXPECT_THAT((*stream)->Ack(*frame), IsOk());
      frames.push_back(frame->positions());
    }
    return frames;
  }

  const PartedBlock block_;
};

TEST_F(ContactSessionsTest, AnswersAreThoseOfThisProcessToTheLastBit) {
  const auto client = Connect();
  const PlanProblem problem = Problem(block_.rows);
  const v1::Session session = MakeContactSession(client.get(), problem);
  EXPECT_EQ(session.contact_row_count(), static_cast<int64_t>(block_.rows.size()));
  int64_t pressing = 0;
  for (const HandlePose& pose : Poses()) {
    const Deformation expected = Solve(problem, pose);
    ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                         client->DeformOnce(session.name(), TopPose(pose)));
    EXPECT_EQ(answer.positions(), Float32Bytes(expected.positions));
    ASSERT_TRUE(answer.summary().has_contact());
    EXPECT_EQ(ToContactSummary(answer.summary().contact()),
              SummarizeContact(expected.contact, problem.deformer.model));
    pressing += answer.summary().contact().pressing_row_count();
  }
  EXPECT_GT(pressing, 0);
}

TEST_F(ContactSessionsTest, ADragShowsTheSingleAnswers) {
  const auto client = Connect();
  const PlanProblem problem = Problem(block_.rows);
  const v1::Session session = MakeContactSession(client.get(), problem);
  const std::vector<std::string> frames = Drag(client.get(), session);
  DeformStream::Options prepared;
  prepared.prepared.emplace();
  const std::vector<std::string> quick = Drag(client.get(), session, prepared);
  for (size_t i = 0; i < frames.size(); ++i) {
    const Positions single = Solve(problem, Poses()[i]).positions;
    ASSERT_OK_AND_ASSIGN(const Positions direct, DecodePositions(frames[i], single.rows()));
    EXPECT_LT((direct - single).cwiseAbs().maxCoeff(), 1e-6) << "mm, at pose " << i;
    ASSERT_OK_AND_ASSIGN(const Positions answered, DecodePositions(quick[i], single.rows()));
    EXPECT_LT((answered - single).rowwise().norm().maxCoeff(), 0.01) << i;
  }
}

TEST_F(ContactSessionsTest, AClientEvaluatesPreparedAnswersWithContact) {
  const auto client = Connect();
  const PlanProblem problem = Problem(block_.rows);
  const v1::Session session = MakeContactSession(client.get(), problem);
  DeformStream::Options options;
  options.prepared.emplace();
  ASSERT_OK_AND_ASSIGN(const auto evaluator, client->FetchPreparedAnswers(session, options));
  for (const HandlePose& pose : Poses()) {
    ASSERT_OK_AND_ASSIGN(const auto near, evaluator->Evaluate(TopPose(pose)));
    ASSERT_TRUE(near.has_value());
    const Positions expected = Solve(problem, pose).positions;
    const Eigen::Map<const FloatPositions> given(near->positions.data(), expected.rows(), 3);
    EXPECT_LE((given.cast<double>() - expected).rowwise().norm().maxCoeff(), 0.01);
  }
}

TEST_F(ContactSessionsTest, NewRegionsReplaceTheRows) {
  const auto client = Connect();
  const PlanProblem touching = Problem(block_.rows);
  const PlanProblem sticking = Problem({});
  const HandlePose pose = Poses()[2];
  const std::string with = Float32Bytes(Solve(touching, pose).positions);
  const std::string without = Float32Bytes(Solve(sticking, pose).positions);
  ASSERT_NE(with, without);
  const v1::Session session = MakeContactSession(client.get(), touching);
  v1::UpdateSessionRequest update;
  update.set_name(session.name());
  for (const PlanProblem* problem : {&sticking, &touching}) {
    const v1::CreateSessionRequest whole = ToProto(SessionRequestOf(*problem, ""));
    v1::SessionRegions* regions = update.mutable_regions();
    *regions->mutable_fixed_vertices() = whole.fixed_vertices();
    *regions->mutable_handles() = whole.handles();
    *regions->mutable_contact() = whole.contact();
    ASSERT_OK_AND_ASSIGN(const v1::Session after, client->UpdateSession(update));
    EXPECT_EQ(after.contact_row_count(), whole.contact_size());
    EXPECT_EQ(Answer(client.get(), session, pose), problem == &touching ? with : without);
  }
  // Another change keeps them.
  v1::UpdateSessionRequest stiffness;
  stiffness.set_name(session.name());
  stiffness.mutable_stiffness()->set_uniform_pa(9000);
  ASSERT_OK_AND_ASSIGN(const v1::Session after, client->UpdateSession(stiffness));
  EXPECT_EQ(after.contact_row_count(), session.contact_row_count());
}

TEST_F(ContactSessionsTest, SessionsWithAndWithoutRowsShareNothing) {
  const auto client = Connect();
  const PlanProblem touching = Problem(block_.rows);
  const PlanProblem sticking = Problem({});
  const v1::Session one = MakeContactSession(client.get(), touching);
  const v1::Session other = MakeContactSession(client.get(), sticking);
  EXPECT_EQ(other.contact_row_count(), 0);
  const HandlePose pose = Poses()[4];
  EXPECT_EQ(Answer(client.get(), one, pose), Float32Bytes(Solve(touching, pose).positions));
  EXPECT_EQ(Answer(client.get(), other, pose), Float32Bytes(Solve(sticking, pose).positions));
}

TEST_F(ContactSessionsTest, PredictionsDistinguishRecipesWithOtherRows) {
  const auto client = Connect();
  std::vector<std::string> recipes;
  for (const auto& rows : {block_.rows, std::vector<ContactRow>{}, block_.rows}) {
    const v1::Session session = MakeContactSession(client.get(), Problem(rows));
    ASSERT_OK_AND_ASSIGN(const v1::Prediction prediction,
                         client->predictions().Create(session.name(), TopPose(Poses()[2])));
    EXPECT_EQ(prediction.summary().has_contact(), !rows.empty());
    recipes.push_back(prediction.recipe_sha256());
  }
  EXPECT_NE(recipes[0], recipes[1]);
  EXPECT_EQ(recipes[0], recipes[2]);
}

TEST_F(ContactSessionsTest, UncertaintyBandIsRefusedAndNotRequestedForPlans) {
  const auto client = Connect();
  PlanProblem problem = Problem(block_.rows);
  MaterialUncertainty& ranges = problem.uncertainty.emplace();
  ranges.tissues = {{"one", 2}, {"other", 1.5}};
  ranges.tissue_of_tet.assign(static_cast<size_t>(block_.mesh.num_tets()), 0);
  ranges.tissue_of_tet.back() = 1;
  const v1::Session session = MakeContactSession(client.get(), problem);
  DeformStream::Options options;
  *options.prepared.emplace().mutable_ranges() = ToProto(ranges);
  EXPECT_THAT(client->OpenStream(session.name(), options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("band of uncertainty")));
  options.prepared = PreparedAnswersOf(problem);
  EXPECT_THAT(client->OpenStream(session.name(), options), IsOk());
}

TEST_F(ContactSessionsTest, SealedLipsAreThoseOfThisProcessAndFreeOnesStayFree) {
  const auto client = Connect();
  const PlanProblem free = SealProblem(false);
  const PlanProblem sealed = SealProblem(true);
  const v1::Session one = MakeContactSession(client.get(), free);
  const v1::Session other = MakeContactSession(client.get(), sealed);
  EXPECT_EQ(one.sealed_pair_count(), 0);
  EXPECT_EQ(other.sealed_pair_count(), 3);
  DeformStream::Options prepared;
  prepared.prepared.emplace();
  const std::vector<std::string> frames = Drag(client.get(), other, prepared);
  const std::vector<std::string> of_free = Drag(client.get(), one, prepared);
  double sealed_by_mm = 0;
  for (size_t i = 0; i < Poses().size(); ++i) {
    const HandlePose pose = Poses()[i];
    const Deformation expected = Solve(sealed, pose);
    ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                         client->DeformOnce(other.name(), TopPose(pose)));
    EXPECT_EQ(answer.positions(), Float32Bytes(expected.positions));
    ASSERT_TRUE(answer.summary().has_seal());
    EXPECT_EQ(ToSealAnswer(answer.summary().seal()), expected.seal);
    EXPECT_EQ(answer.summary().seal().release_mm(), kSealReleaseMm);
    ASSERT_OK_AND_ASSIGN(const Positions dragged,
                         DecodePositions(frames[i], expected.positions.rows()));
    EXPECT_LT((dragged - expected.positions).rowwise().norm().maxCoeff(), 0.01);
    const Positions parted = Solve(free, pose).positions;
    EXPECT_EQ(Answer(client.get(), one, pose), Float32Bytes(parted));
    ASSERT_OK_AND_ASSIGN(const Positions free_frame, DecodePositions(of_free[i], parted.rows()));
    EXPECT_LT((free_frame - parted).rowwise().norm().maxCoeff(), 0.01);
    sealed_by_mm = std::max(sealed_by_mm, (expected.positions - parted).cwiseAbs().maxCoeff());
  }
  EXPECT_GT(sealed_by_mm, 0.1);
}

class ContactBandTest : public ContactSessionsTest {
 protected:
  // Half the block is one tissue, the other half is known.
  ContactBandTest() {
    ranges_.tissues = {{"", 1}, {"", 2}};
    for (Eigen::Index t = 0; t < block_.mesh.num_tets(); ++t) {
      const double z = block_.mesh.positions()(block_.mesh.tets().row(t), 2).mean();
      ranges_.tissue_of_tet.push_back(z < 2 ? 0 : 1);
    }
  }

  // With the stiffness of the uncertain tissue times `factor`.
  PlanProblem WithFactor(PlanProblem problem, double factor) const {
    for (Eigen::Index t = 0; t < problem.stiffness.size(); ++t) {
      if (ranges_.tissue_of_tet[static_cast<size_t>(t)] == 1) problem.stiffness[t] *= factor;
    }
    return problem;
  }

  v1::DeformOnceRequest Request(const v1::Session& session, v1::DeformationModel model,
                                const HandlePose& pose) const {
    v1::DeformOnceRequest request;
    request.set_session(session.name());
    request.set_model(model);
    for (const NamedPose& named : TopPose(pose)) *request.add_poses() = ToProto(named);
    *request.mutable_ranges() = ToProto(ranges_);
    return request;
  }

  MaterialUncertainty ranges_;
};

// What the other stiffness does is found by solving, not by expanding.
TEST_F(ContactBandTest, TheBandIsWhatOtherStiffnessesDo) {
  const auto client = Connect();
  for (const DeformationModel model :
       {DeformationModel::kLinearElastic, DeformationModel::kNeoHookean}) {
    SCOPED_TRACE(TraitsOf(model).name);
    PlanProblem problem = Problem(block_.rows);
    problem.deformer.model = model;
    const v1::Session session = MakeContactSession(client.get(), problem);
    const HandlePose pose = Poses()[2];
    ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                         client->DeformOnce(Request(session, ToProto(model), pose)));
    EXPECT_EQ(answer.no_uncertainty(), "");
    EXPECT_GT(answer.summary().contact().pressing_row_count(), 0);
    const Eigen::Index count = block_.mesh.num_vertices();
    ASSERT_OK_AND_ASSIGN(const Eigen::VectorXf band,
                         FloatsFromBytes(answer.uncertainty_p95_mm(), count));
    constexpr double kStep = 1e-3;
    const Positions apart = Solve(WithFactor(problem, std::exp(kStep)), pose).positions -
                            Solve(WithFactor(problem, std::exp(-kStep)), pose).positions;
    const Eigen::VectorXd expected = apart.rowwise().norm() * (std::log(2) / (2 * kStep));
    EXPECT_GT(expected.maxCoeff(), 0.01) << "mm";
    EXPECT_LT((band.cast<double>() - expected).cwiseAbs().maxCoeff(), 1e-3 * expected.maxCoeff());
  }
}

TEST_F(ContactBandTest, TheBandIsOfTheSelectedVertices) {
  const auto client = Connect();
  const v1::Session session = MakeContactSession(client.get(), Problem(block_.rows));
  v1::DeformOnceRequest request =
      Request(session, v1::DEFORMATION_MODEL_LINEAR_ELASTIC, Poses()[2]);
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse all, client->DeformOnce(request));
  ASSERT_OK_AND_ASSIGN(const Eigen::VectorXf of_all,
                       FloatsFromBytes(all.uncertainty_p95_mm(), block_.mesh.num_vertices()));
  for (const int32_t vertex : {30, 20, 25}) {
    request.mutable_vertices()->mutable_list()->add_vertices(vertex);
  }
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse some, client->DeformOnce(request));
  ASSERT_OK_AND_ASSIGN(const Eigen::VectorXf of_some,
                       FloatsFromBytes(some.uncertainty_p95_mm(), 3));
  EXPECT_EQ(of_some, Eigen::VectorXf(of_all({30, 20, 25})));
}

TEST_F(ContactBandTest, NoBandIsGivenWhereNoneIsKnown) {
  const auto client = Connect();
  const v1::Session sealed = MakeContactSession(client.get(), SealProblem(true));
  ASSERT_OK_AND_ASSIGN(
      const v1::DeformOnceResponse answer,
      client->DeformOnce(Request(sealed, v1::DEFORMATION_MODEL_LINEAR_ELASTIC, Poses()[1])));
  EXPECT_FALSE(answer.positions().empty());
  EXPECT_EQ(answer.uncertainty_p95_mm(), "");
  EXPECT_THAT(answer.no_uncertainty(), HasSubstr("sealed lips"));
  EXPECT_THAT(client->DeformOnce(Request(sealed, v1::DEFORMATION_MODEL_ARAP, Poses()[1])),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("ranges need linear_elastic or neo_hookean")));
  v1::DeformOnceRequest damaged = Request(sealed, v1::DEFORMATION_MODEL_LINEAR_ELASTIC, Poses()[1]);
  damaged.mutable_ranges()->mutable_tissues()->pop_back();
  EXPECT_THAT(client->DeformOnce(damaged), StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(ContactSessionsTest, PredictionsDistinguishSealedLipsFromFreeOnes) {
  const auto client = Connect();
  std::vector<std::string> recipes;
  for (const PlanProblem& problem : {Problem(block_.rows), SealProblem(false), SealProblem(true)}) {
    const v1::Session session = MakeContactSession(client.get(), problem);
    ASSERT_OK_AND_ASSIGN(const v1::Prediction prediction,
                         client->predictions().Create(session.name(), TopPose(Poses()[1])));
    EXPECT_EQ(prediction.summary().has_seal(), problem.deformer.seal.has_value());
    recipes.push_back(prediction.recipe_sha256());
  }
  EXPECT_EQ(recipes[0], recipes[1]) << "an edge that is not sealed changes no answer";
  EXPECT_NE(recipes[1], recipes[2]);
}

TEST_F(ContactSessionsTest, BadSealsAreRefused) {
  const auto client = Connect();
  const PlanProblem problem = SealProblem(true);
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh,
                       client->UploadMesh(*problem.mesh, {{kArray, problem.stiffness}}));
  const auto refused = [&](auto change, const std::string& why) {
    for (const bool sealed : {true, false}) {
      SessionRequest request = SessionRequestOf(problem, mesh.name());
      request.seals_lips = sealed;
      change(*request.lip_edge);
      EXPECT_THAT(client->CreateSession(request),
                  StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("contact seal: " + why)));
    }
  };
  refused([](LipEdge& edge) { edge.pairs.clear(); }, "there are no pairs");
  refused([](LipEdge& edge) { edge.up *= 2; }, "\"up\" has length 2");
  refused([](LipEdge& edge) { edge.up.x() = std::nan(""); }, "\"up\" has length nan");
  refused([](LipEdge& edge) { edge.pairs[1].upper = -1; }, "pair 1 names vertex -1");
  refused([](LipEdge& edge) { edge.pairs[2] = edge.pairs[0]; }, "pair 2 names vertex");
  SessionRequest request = SessionRequestOf(problem, mesh.name());
  request.model = DeformationModel::kNeoHookean;
  EXPECT_THAT(client->CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("neo_hookean does not compute the lip seal")));
  request = SessionRequestOf(problem, mesh.name());
  request.contact.clear();
  EXPECT_THAT(client->CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("has no contact row")));
}

TEST_F(ContactSessionsTest, BadRowsAreRefusedByTheirIndex) {
  const auto client = Connect();
  const PlanProblem problem = Problem(block_.rows);
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh,
                       client->UploadMesh(*problem.mesh, {{kArray, problem.stiffness}}));
  const auto refused = [&](auto change, const std::string& why) {
    SessionRequest request = SessionRequestOf(problem, mesh.name());
    change(request.contact[1]);
    EXPECT_THAT(client->CreateSession(request),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("contact row 1 " + why)));
  };
  refused([](ContactRow& row) { row.vertex = 0; }, "names vertex 0, which moves with a region");
  refused([](ContactRow& row) { row.vertex = 1 << 20; }, "names vertex");
  refused([](ContactRow& row) { row.normal *= 2; }, "has a normal of length 2");
  refused([](ContactRow& row) { row.normal.x() = std::nan(""); }, "has a normal of length nan");
  refused([](ContactRow& row) { row.bilateral = false, row.gap_mm = -1; }, "has a gap of -1");
  refused([](ContactRow& row) { row.bilateral = false, row.gap_mm = std::nan(""); },
          "has a gap of nan");
  EXPECT_TRUE(client->CreateSession(SessionRequestOf(problem, mesh.name())).ok());
}

TEST_F(ContactSessionsTest, ARestoredSessionShowsTheSameFrames) {
  DurableServer durable("contact", {"--log-level", "warn"});
  ASSERT_THAT(durable.Start(), IsOk());
  const PlanProblem problem = SealProblem(true);
  v1::Session session;
  std::vector<std::string> before;
  {
    ASSERT_OK_AND_ASSIGN(const auto client, durable.Connect());
    session = MakeContactSession(client.get(), problem, "a-session-in-mid-contact");
    before = Drag(client.get(), session);
  }
  ASSERT_THAT(durable.Kill(), IsOk());
  ASSERT_THAT(durable.Start(), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto client, durable.Connect());
  ASSERT_OK_AND_ASSIGN(const v1::Session stored, client->GetSession(session.name()));
  EXPECT_EQ(stored.etag(), session.etag());
  EXPECT_EQ(stored.contact_row_count(), session.contact_row_count());
  EXPECT_EQ(stored.sealed_pair_count(), 3);
  EXPECT_EQ(Drag(client.get(), session), before);
}

}  // namespace
}  // namespace tissueform::testing
