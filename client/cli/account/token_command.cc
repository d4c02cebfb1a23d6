// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/token_command.h"

#include <chrono>
#include <iostream>
#include <iterator>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

#include "client/cli/account/token_work.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxShownBytes = 65536;

void AddKeygen(CLI::App* token, CommandWork* work) {
  struct Options {
    std::string out;
    int rsa_bits = 0;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = token->add_subcommand("keygen", "create a key pair for signing tokens");
  command
      ->add_option("--out", options->out,
                   "folder for the files; existing files are not overwritten")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--rsa", options->rsa_bits,
                   "create an RSA key of this size in bits (RS256) instead of P-256 (ES256)")
      ->check(CLI::IsMember({2048, 3072, 4096}));
  command->footer(
      "Writes into DIR:\n"
      "  private.pem  signs tokens: anyone who has it can impersonate every user. Keep it off the "
      "server.\n"
      "  public.pem, jwks.json  the public key for --token-keys, in two forms\n"
      "Example:\n"
      "  tissueform token keygen --out keys\n"
      "  tissueform-server --token-issuer https://keys.example --token-audience tissueform \\\n"
      "    --token-keys keys/jwks.json");
  command->callback([options, work] {
    *work = [options]() -> absl::Status {
      TF_RETURN_IF_ERROR(MakeKeyFiles(options->out, options->rsa_bits));
      std::cout << "created private.pem, public.pem and jwks.json in " << options->out << "\n";
      return absl::OkStatus();
    };
  });
}

void AddMake(CLI::App* token, CommandWork* work) {
  struct Options {
    std::string key;
    TokenWords words;
  };
  auto options = std::make_shared<Options>();
  TokenWords& words = options->words;
  CLI::App* command = token->add_subcommand("make", "create a short-lived token and print it");
  command->add_option("--key", options->key, "private.pem of `token keygen`")
      ->required()
      ->type_name("FILE");
  command->add_option("--issuer", words.issuer, "as in the server's --token-issuer")->required();
  command->add_option("--audience", words.audiences, "as in the server's --token-audience")
      ->required();
  command->add_option("--subject", words.subject, "principal: 1 to 128 printable characters")
      ->required();
  command
      ->add_option(
          "--lifetime", words.lifetime_seconds,
          absl::StrCat("lifetime in seconds, at most ", kMaxTokenLifetimeSeconds, " (12 hours)"))
      ->check(CLI::Range(int64_t{1}, kMaxTokenLifetimeSeconds))
      ->capture_default_str();
  command->add_option("--role", words.roles, "publisher, bridge or admin (repeatable)")
      ->check(CLI::IsMember({"publisher", "bridge", "admin"}));
  command->add_option("--project", words.projects, "a project (repeatable)");
  command->footer(
      "Protect a token like a password, in a file that only you can read:\n"
      "  (umask 077; tissueform token make --key keys/private.pem --issuer https://keys.example "
      "\\\n"
      "     --audience tissueform --subject alice > token)\n"
      "Only the server's --token-revocations can revoke it (docs/security.md).");
  command->callback([options, work] {
    *work = [options]() -> absl::Status {
      TF_ASSIGN_OR_RETURN(const std::string made, MakeTokenWith(options->key, options->words));
      std::cout << made << "\n";
      return absl::OkStatus();
    };
  });
}

// Of a file, or of standard input where `path` is empty.
absl::StatusOr<nlohmann::json> Show(const std::string& path) {
  const auto now = std::chrono::system_clock::now();
  if (!path.empty()) return ShowTokenFile(path, now);
  std::string text(kMaxShownBytes, '\0');
  std::cin.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(std::cin.gcount()));
  return ShowToken(absl::StripAsciiWhitespace(text), now);
}

void AddShow(CLI::App* token, CommandWork* work) {
  auto file = std::make_shared<std::string>();
  CLI::App* command =
      token->add_subcommand("show", "print the contents of a token as JSON, without verification");
  command
      ->add_option("FILE", *file,
                   "token file, as written by `tissueform login` and `token make > FILE`"
                   "; without FILE: standard input")
      ->type_name("");
  command->footer(
      "Shows header and claims, times as dates, and whether the token is valid now. The signature\n"
      "is neither shown nor verified. \"token_digest\" identifies\n"
      "the token in a revocation list. A token is not an argument, because other\n"
      "users of a machine can see arguments.\n"
      "Examples:\n"
      "  tissueform token show ~/.config/tissueform/token\n"
      "  tissueform token show < token");
  command->callback([file, work] {
    *work = [file]() -> absl::Status {
      TF_ASSIGN_OR_RETURN(const nlohmann::json shown, Show(*file));
      std::cout << shown.dump(2, ' ', true) << "\n";
      std::cerr << "not verified\n";
      return absl::OkStatus();
    };
  });
}

}  // namespace

void AddTokenCommand(CLI::App& app, CommandWork* work) {
  CLI::App* token = app.add_subcommand(
      "token", "keys and short-lived tokens, for tests and sites without a provider");
  token->require_subcommand(1);
  token->footer(
      "Examples:\n"
      "  tissueform token keygen --out keys\n"
      "  tissueform token make --key keys/private.pem --issuer https://keys.example \\\n"
      "    --audience tissueform --subject alice --lifetime 3600\n"
      "  tissueform token show token");
  AddKeygen(token, work);
  AddMake(token, work);
  AddShow(token, work);
}

}  // namespace tissueform
