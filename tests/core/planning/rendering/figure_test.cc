// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/figure.h"

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <unistd.h>

#include <sys/socket.h>
#include <sys/un.h>

#include "core/planning/rendering/virtual_display.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/killed_starter.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"

#if defined(__SANITIZE_ADDRESS__)
// Mesa's driver, with which VTK draws, leaks a few bytes and is unloaded before leaks are looked
// for, so no suppression can name it.
extern "C" int __lsan_is_turned_off();               // NOLINT
extern "C" int __lsan_is_turned_off() { return 1; }  // NOLINT
#endif

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::ScopedEnvironment;
using testing::StatusIs;

SurfaceLayer OneTriangle() {
  SurfaceLayer surface;
  surface.positions.resize(3, 3);
  surface.positions << 0, 0, 0, 2, 0, 0, 0, 0, 1;
  surface.triangles.resize(1, 3);
  surface.triangles << 0, 1, 2;
  return surface;
}

Figure SmallFigure() {
  Scene plain;
  plain.title = "a triangle";
  plain.surfaces = {OneTriangle()};
  Scene coloured = plain;
  coloured.surfaces[0].vertex_values = Eigen::Vector3d(0, 0.5, 1);
  coloured.colour_bar = {"value [mm]", 0, 1};
  Chart chart;
  chart.curves = {{"line", {1, 2, 3}, {1, 10, 100}}};
  chart.logarithmic_y = true;
  Figure figure("a figure", 400);
  figure.AddRow(200, {plain, coloured});
  figure.AddRow(150, {chart});
  return figure;
}

// Big-endian number of four bytes.
int NumberAt(const std::string& bytes, size_t offset) {
  int number = 0;
  for (size_t b = 0; b < 4; ++b) number = 256 * number + static_cast<uint8_t>(bytes[offset + b]);
  return number;
}

// A display for every test; without Xvfb and without a display there is nothing to test.
class FigureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto display = VirtualDisplay::Open();
    if (absl::IsNotFound(display.status())) GTEST_SKIP() << display.status();
    ASSERT_THAT(display, IsOk());
    display_ = *std::move(display);
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }

  // A small picture of that scene alone: a number that distinguishes pictures.
  size_t PictureOf(const Scene& scene) const {
    Figure figure("", 120);
    figure.AddRow(100, {scene});
    EXPECT_THAT(figure.WritePng(folder_ + "/scene.png"), IsOk());
    return std::hash<std::string>()(testing::BytesOfFile(folder_ + "/scene.png"));
  }

  // One for each test: tests run side by side.
  const std::string folder_ = ::testing::TempDir() + "/client_rendering_test/" +
                              ::testing::UnitTest::GetInstance()->current_test_info()->name();
  std::unique_ptr<VirtualDisplay> display_;
};

TEST_F(FigureTest, PngHasTheSizeOfItsRowsWithTitleAndFooter) {
  const std::string path = folder_ + "/figure.png";
  ASSERT_THAT(SmallFigure().WritePng(path), IsOk());
  const std::string bytes = testing::BytesOfFile(path);
  ASSERT_GT(bytes.size(), 1000U);
  EXPECT_EQ(bytes.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(NumberAt(bytes, 16), 400);
  EXPECT_GT(NumberAt(bytes, 20), 200 + 150);
  EXPECT_LT(NumberAt(bytes, 20), 200 + 150 + 150);
}

TEST_F(FigureTest, SameFigureGivesTheSamePicture) {
  ASSERT_THAT(SmallFigure().WritePng(folder_ + "/one.png"), IsOk());
  ASSERT_THAT(SmallFigure().WritePng(folder_ + "/two.png"), IsOk());
  EXPECT_EQ(testing::BytesOfFile(folder_ + "/one.png"), testing::BytesOfFile(folder_ + "/two.png"));
}

TEST_F(FigureTest, PanelsWithRoomForEachOtherHaveOneCamera) {
  Scene far;
  far.surfaces = {OneTriangle()};
  far.surfaces[0].positions *= 2;
  Scene near = far;
  near.surfaces = {OneTriangle()};
  Scene with_room = near;
  with_room.room_for = near.surfaces[0].positions;
  EXPECT_EQ(PictureOf(with_room), PictureOf(near)) << "room that is there changes nothing";
  // Only the camera: nothing of the far triangle is drawn.
  with_room.room_for = far.surfaces[0].positions;
  Scene both = with_room;
  both.surfaces.push_back(far.surfaces[0]);
  both.surfaces[1].opacity = 0;
  EXPECT_NE(PictureOf(with_room), PictureOf(near));
  EXPECT_EQ(PictureOf(with_room), PictureOf(both));
}

TEST_F(FigureTest, EndsOfABarHaveTheEndsOfThePalette) {
  Scene scene;
  scene.surfaces = {OneTriangle()};
  scene.surfaces[0].edges = false;
  const auto picture_of_value = [&](double value) {
    scene.surfaces[0].vertex_values = Eigen::Vector3d::Constant(value);
    return PictureOf(scene);
  };
  const auto picture_of_colour = [&](const Colour& colour) {
    scene.surfaces[0].vertex_values = {};
    // As a table of colours rounds.
    scene.surfaces[0].colour = ((255 * colour).array() + 0.5).floor() / 255;
    return PictureOf(scene);
  };
  EXPECT_EQ(picture_of_value(0), picture_of_colour(MapColours().front()));
  EXPECT_EQ(picture_of_value(1), picture_of_colour(MapColours().back()));
  EXPECT_EQ(picture_of_value(7), picture_of_value(1)) << "beyond the end";
  EXPECT_NE(picture_of_value(0.5), picture_of_value(1));
}

TEST_F(FigureTest, SmoothShadingChangesBentSurfacesOnly) {
  Scene scene;
  scene.surfaces = {OneTriangle()};
  scene.surfaces[0].edges = false;
  const size_t flat = PictureOf(scene);
  scene.surfaces[0].smooth = true;
  EXPECT_EQ(PictureOf(scene), flat);

  SurfaceLayer& bent = scene.surfaces[0];
  bent.positions.conservativeResize(4, 3);
  bent.positions.row(3) << 2, 0.5, 1;
  bent.triangles.conservativeResize(2, 3);
  bent.triangles.row(1) << 1, 3, 2;
  const size_t smooth = PictureOf(scene);
  bent.smooth = false;
  EXPECT_NE(PictureOf(scene), smooth);
}

TEST_F(FigureTest, MissingFolderIsNamed) {
  EXPECT_THAT(SmallFigure().WritePng(folder_ + "/nowhere/figure.png"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nowhere")));
}

TEST_F(FigureTest, OwnDisplayIsUsableAndGoneAfterwards) {
  display_.reset();
  const ScopedEnvironment unusable("DISPLAY", ":71234");
  {
    ASSERT_OK_AND_ASSIGN(const auto own, VirtualDisplay::Open());
    EXPECT_TRUE(DisplayOpens());
    EXPECT_STRNE(std::getenv("DISPLAY"), ":71234");
  }
  EXPECT_STREQ(std::getenv("DISPLAY"), ":71234");
  EXPECT_FALSE(DisplayOpens());
}

// A connection to the X display of that name; -1 without one.
int ConnectTo(const std::string& display) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = "/tmp/.X11-unix/X" + display.substr(display.find(':') + 1);
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  const int connection = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
    return connection;
  }
  close(connection);
  return -1;
}

TEST(VirtualDisplayTest, EndsWhenItsStarterIsKilled) {
  const ScopedEnvironment no_display("DISPLAY", nullptr);
  testing::KilledStarter starter([]() -> std::string {
    auto display = VirtualDisplay::Open();
    if (!display.ok()) return std::string(absl::StatusCodeToString(display.status().code()));
    [[maybe_unused]] const VirtualDisplay* kept_to_the_end = display->release();
    return std::getenv("DISPLAY");
  });
  if (starter.word() == "NOT_FOUND") GTEST_SKIP() << "without Xvfb";
  const int connection = ConnectTo(starter.word());
  ASSERT_GE(connection, 0) << starter.word();
  starter.Kill();
  EXPECT_TRUE(testing::Closes(connection));
  close(connection);
}

TEST(VirtualDisplayTest, MissingXvfbNamesItsPackage) {
  const ScopedEnvironment no_display("DISPLAY", nullptr);
  const ScopedEnvironment no_programs("PATH", "/nonexistent");
  EXPECT_THAT(VirtualDisplay::Open(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("install the package xvfb")));
}

}  // namespace
}  // namespace tissueform
