// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/program_options.h"

#include <algorithm>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/gateway/gateway_options.h"
#include "server/app/server_options.h"
#include "tests/testing/scoped_environment.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

struct Settings {
  int port = 7;
  bool quiet = false;
  std::string folder;
  std::string url;
  std::string mode = "strict";  // of the address
  std::vector<std::string> names;
};

// A program with an option of each kind.
class ProgramOptionsTest : public ::testing::Test {
 protected:
  struct Outcome {
    Settings settings;
    std::optional<int> end;
    std::string out;
    std::string err;
  };

  Outcome Parse(const std::vector<std::string>& arguments) const {
    Outcome outcome;
    CLI::App app("Tests options.", "program");
    app.add_option("--port", outcome.settings.port)->check(CLI::Range(0, 9))->capture_default_str();
    CLI::Option* quiet = app.add_flag("--quiet", outcome.settings.quiet);
    app.add_option("--folder", outcome.settings.folder)->excludes(quiet);
    CLI::Option* url = app.add_option("--url", outcome.settings.url);
    app.add_option("--mode", outcome.settings.mode)->needs(url)->capture_default_str();
    app.add_option("--name", outcome.settings.names);
    AddConfiguration(app, "PROGRAM_TEST_");
    std::vector<const char*> words = {"program"};
    for (const std::string& argument : arguments) words.push_back(argument.c_str());
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    outcome.end = ParseProgramOptions(app, static_cast<int>(words.size()), words.data());
    outcome.out = ::testing::internal::GetCapturedStdout();
    outcome.err = ::testing::internal::GetCapturedStderr();
    return outcome;
  }

  std::string File(const std::string& text) const {
    std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::replace(name.begin(), name.end(), '/', '_');
    const std::string path = absl::StrCat(::testing::TempDir(), name, ".ini");
    std::ofstream(path) << text;
    return path;
  }
};

TEST_F(ProgramOptionsTest, TheCommandLineWinsOverTheEnvironmentAndThatOverTheFile) {
  const std::string file = File("port = 1\n");
  EXPECT_EQ(Parse({}).settings.port, 7);
  EXPECT_EQ(Parse({"--config", file}).settings.port, 1);
  const ScopedEnvironment variable("PROGRAM_TEST_PORT", "2");
  EXPECT_EQ(Parse({}).settings.port, 2);
  EXPECT_EQ(Parse({"--config", file}).settings.port, 2);
  EXPECT_EQ(Parse({"--config", file, "--port", "3"}).settings.port, 3);
}

TEST_F(ProgramOptionsTest, IgnoresAnEmptyVariable) {
  const ScopedEnvironment variable("PROGRAM_TEST_PORT", "");
  EXPECT_EQ(Parse({"--config", File("port = 1\n")}).settings.port, 1);
}

TEST_F(ProgramOptionsTest, AVariableMayNameTheFile) {
  const ScopedEnvironment variable("PROGRAM_TEST_CONFIG", File("port = 1\n").c_str());
  EXPECT_EQ(Parse({}).settings.port, 1);
  const ScopedEnvironment missing("PROGRAM_TEST_CONFIG", "/nowhere.ini");
  EXPECT_EQ(Parse({}).end, 2);
}

TEST_F(ProgramOptionsTest, FalseFlagCountsAsNotGiven) {
  const std::string file = File("quiet = false\nfolder = /a\n");
  EXPECT_EQ(Parse({"--config", file}).settings.folder, "/a");
  EXPECT_TRUE(Parse({"--config", File("quiet = true\n")}).settings.quiet);
  const ScopedEnvironment variable("PROGRAM_TEST_QUIET", "false");
  EXPECT_EQ(Parse({"--folder", "/b"}).settings.folder, "/b");
  EXPECT_FALSE(Parse({"--config", File("quiet = true\n")}).settings.quiet);
}

TEST_F(ProgramOptionsTest, AVariableHoldsSeveralValuesInBrackets) {
  const ScopedEnvironment variable("PROGRAM_TEST_NAME", "[a,b]");
  EXPECT_THAT(Parse({}).settings.names, ElementsAre("a", "b"));
}

TEST_F(ProgramOptionsTest, LinesOfOneNameAddUpWhereTheOptionTakesSeveral) {
  EXPECT_THAT(Parse({"--config", File("name = a\nport = 1\nname = b\n")}).settings.names,
              ElementsAre("a", "b"));
  EXPECT_EQ(Parse({"--config", File("port = 1\nquiet = true\nport = 2\n")}).end, 2);
}

struct BadFile {
  const char* name;
  const char* text;
  const char* complaint;
};

class BadFileTest : public ProgramOptionsTest, public ::testing::WithParamInterface<BadFile> {};

TEST_P(BadFileTest, EndsTheProgramWithOneLine) {
  const std::string file = File(GetParam().text);
  const Outcome outcome = Parse({"--config", file});
  EXPECT_EQ(outcome.end, 2);
  EXPECT_THAT(outcome.err, StartsWith("program: "));
  EXPECT_THAT(outcome.err, HasSubstr(GetParam().complaint));
  EXPECT_EQ(outcome.err.find('\n'), outcome.err.size() - 1);
  EXPECT_EQ(outcome.out, "");
}

INSTANTIATE_TEST_SUITE_P(
    , BadFileTest,
    ::testing::Values(BadFile{"UnknownOption", "prot = 1\n", ".ini: there is no option \"prot\""},
                      BadFile{"ATokenInItsPlace", "eyJhbGciOiJFUzI1NiJ9.eyJzdWIiOiJhIn0.c2ln\n",
                              ".ini: it is not a file of options"},
                      BadFile{"Section", "[server]\nport = 1\n", "section [server]"},
                      BadFile{"AnotherFile", "config = /x.ini\n", "no option \"config\""},
                      BadFile{"OutOfRange", "port = 12\n", "--port"},
                      BadFile{"NoNumber", "port = many\n", "--port"}),
    [](const auto& param) { return std::string(param.param.name); });

TEST_F(ProgramOptionsTest, PrintedConfigReadsBackUnchanged) {
  for (const std::string& folder :
       {std::string("/var/lib/a b"), std::string("a, b"), std::string("it's"), std::string("\"x\""),
        std::string("[1"), std::string("a;b=c"), std::string(" ")}) {
    const Outcome printed = Parse({"--print-config", "--port", "3", "--folder", folder, "--name",
                                   "a b", "--name", "c,d", "--name", "e"});
    ASSERT_EQ(printed.end, 0);
    const Outcome read = Parse({"--config", File(printed.out)});
    EXPECT_EQ(read.err, "");
    EXPECT_EQ(read.settings.port, 3);
    EXPECT_EQ(read.settings.folder, folder);
    EXPECT_THAT(read.settings.names, ElementsAre("a b", "c,d", "e"));
    EXPECT_EQ(Parse({"--config", File(printed.out), "--print-config"}).out, printed.out);
  }
}

TEST_F(ProgramOptionsTest, ValuesThatAFileCannotHoldBecomeComments) {
  for (const char* folder : {"a#b", "a\nport = 1", "'\"", "a`b"}) {
    const Outcome printed = Parse({"--print-config", "--folder", folder});
    EXPECT_THAT(printed.out, HasSubstr("# folder has a character"));
    EXPECT_EQ(Parse({"--config", File(printed.out)}).settings.port, 7);
  }
}

TEST_F(ProgramOptionsTest, SecretsOfAddressesAreHidden) {
  const std::string out =
      Parse({"--print-config", "--url", "https://me:verysecret@host:1/p@th?key=secrettoo"}).out;
  EXPECT_THAT(out, Not(HasSubstr("secret")));
  EXPECT_THAT(out, HasSubstr("url = https://HIDDEN@host:1/p@th?HIDDEN\n"));
}

TEST_F(ProgramOptionsTest, ADefaultThatNeedsAnotherOptionIsAComment) {
  EXPECT_THAT(Parse({"--print-config"}).out, HasSubstr("\n# mode = strict\n"));
  EXPECT_THAT(Parse({"--print-config", "--url", "a", "--mode", "mild"}).out,
              HasSubstr("\nmode = mild\n"));
}

struct Program {
  const char* name;
  std::function<void(CLI::App&)> add;
  std::vector<std::string> needed;
};

void AddToServer(CLI::App& app) {
  // Lives as long as the test program: options of an app write into it.
  static ServerOptions options;
  options = ServerOptions::Defaults();
  AddServerOptions(app, &options);
}

void AddToGateway(CLI::App& app) {
  static GatewayOptions options;
  options = {};
  AddGatewayOptions(app, &options);
}

class ProgramsOptionsTest : public ::testing::TestWithParam<Program> {};

TEST_P(ProgramsOptionsTest, EveryOptionHasAVariable) {
  CLI::App app;
  GetParam().add(app);
  for (const CLI::Option* option : app.get_options()) {
    EXPECT_NE(option->get_envname().empty(), option->get_configurable()) << option->get_name();
  }
}

TEST_P(ProgramsOptionsTest, DefaultsReadBackAsTheSame) {
  CLI::App app("", GetParam().name);
  GetParam().add(app);
  std::vector<std::string> arguments = GetParam().needed;
  app.parse(arguments);
  const std::string printed = PrintedConfiguration(app);
  const std::string path = absl::StrCat(::testing::TempDir(), GetParam().name, "_defaults.ini");
  std::ofstream(path) << printed;
  CLI::App again("", GetParam().name);
  GetParam().add(again);
  arguments = {path, "--config"};  // CLI11 takes them from the end
  again.parse(arguments);
  EXPECT_EQ(PrintedConfiguration(again), printed);
}

INSTANTIATE_TEST_SUITE_P(
    , ProgramsOptionsTest,
    ::testing::Values(Program{"Server", AddToServer, {}},
                      Program{"Gateway", AddToGateway, {"localhost:1", "--server"}}),
    [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace tissueform::testing
