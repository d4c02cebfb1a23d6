// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/certificates.h"

#include <algorithm>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

template <auto Free>
struct Freer {
  template <typename T>
  void operator()(T* pointer) const {
    Free(pointer);
  }
};
using Bio = std::unique_ptr<BIO, Freer<BIO_free_all>>;
using Certificate = std::unique_ptr<X509, Freer<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY_free>>;
using GeneralNames = std::unique_ptr<GENERAL_NAMES, Freer<GENERAL_NAMES_free>>;

constexpr int kMaxCertificates = 10'000;

Bio BioOf(absl::string_view text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

absl::Status NoCertificate() {
  return absl::InvalidArgumentError("has no certificate in PEM (\"-----BEGIN CERTIFICATE-----\")");
}

// Never asks a terminal for the password of an encrypted key.
int NoPassword(char*, int, int, void*) { return -1; }

std::chrono::system_clock::time_point TimeOf(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return {};
  return std::chrono::system_clock::from_time_t(timegm(&parts));
}

std::string TextOfAsn1(const ASN1_STRING* string) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(string)),
          static_cast<size_t>(ASN1_STRING_length(string))};
}

// "DNS:planner.example.org" and "IP Address:192.0.2.1", as OpenSSL writes them, less what stands
// before the colon.
std::string NameText(const GENERAL_NAME* name) {
  const Bio out(BIO_new(BIO_s_mem()));
  if (out == nullptr || GENERAL_NAME_print(out.get(), const_cast<GENERAL_NAME*>(name)) != 1) {
    return {};
  }
  char* data = nullptr;
  const int64_t size = BIO_get_mem_data(out.get(), &data);
  const std::string text(data, static_cast<size_t>(size));
  return text.substr(std::min(text.find(':') + 1, text.size()));
}

std::vector<std::string> NamesOf(const X509* certificate) {
  std::vector<std::string> names;
  const GeneralNames alternatives(static_cast<GENERAL_NAMES*>(
      X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr)));
  const int count = sk_GENERAL_NAME_num(alternatives.get());
  names.reserve(static_cast<size_t>(std::max(count, 0)));
  for (int i = 0; i < count; ++i) {
    names.push_back(NameText(sk_GENERAL_NAME_value(alternatives.get(), i)));
  }
  if (!names.empty()) return names;
  const X509_NAME* subject = X509_get_subject_name(certificate);
  const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1);
  if (at >= 0) {
    names.push_back(TextOfAsn1(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at))));
  }
  return names;
}

Certificate FirstCertificate(absl::string_view pem) {
  Certificate first(PEM_read_bio_X509(BioOf(pem).get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  return first;
}

std::string DateText(std::chrono::system_clock::time_point time) {
  return absl::FormatTime("%Y-%m-%d %H:%M UTC", absl::FromChrono(time), absl::UTCTimeZone());
}

absl::Status CheckDates(const CertificateFacts& facts, std::chrono::system_clock::time_point now) {
  if (now > facts.not_after) {
    return absl::InvalidArgumentError(
        absl::StrCat("the certificate expired on ", DateText(facts.not_after), "; replace it"));
  }
  if (now < facts.not_before) {
    return absl::InvalidArgumentError(absl::StrCat("the certificate is valid from ",
                                                   DateText(facts.not_before),
                                                   "; check the clock of this machine"));
  }
  return absl::OkStatus();
}

absl::Status WithFile(const absl::Status& status, const std::string& path) {
  if (status.ok()) return status;
  return {status.code(), absl::StrCat(path, ": ", status.message())};
}

}  // namespace

absl::StatusOr<std::string> ReadPemFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text(kMaxPemBytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  if (!file.is_open() || file.bad()) {
    return absl::NotFoundError(
        absl::StrCat(path, ": cannot be read; check that it exists and its permissions"));
  }
  if (text.empty() || text.size() > kMaxPemBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, text.empty() ? ": is empty, or not a file" : ": is larger than 1 MiB",
                     "; give a PEM file"));
  }
  return text;
}

absl::StatusOr<std::string> ReadSecretPemFile(const std::string& path) {
  std::error_code error;
  const std::filesystem::perms modes = std::filesystem::status(path, error).permissions();
  if (!error && (modes & std::filesystem::perms::others_read) != std::filesystem::perms::none) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": every user of this machine can read the key; chmod o-rwx"));
  }
  return ReadPemFile(path);
}

absl::StatusOr<CertificateFacts> ReadCertificate(absl::string_view chain_pem) {
  const Certificate certificate = FirstCertificate(chain_pem);
  if (certificate == nullptr) {
    return NoCertificate();
  }
  return CertificateFacts{.not_before = TimeOf(X509_get0_notBefore(certificate.get())),
                          .not_after = TimeOf(X509_get0_notAfter(certificate.get())),
                          .names = NamesOf(certificate.get())};
}

absl::StatusOr<CertificateFacts> CheckIdentity(absl::string_view chain_pem,
                                               absl::string_view key_pem,
                                               std::chrono::system_clock::time_point now) {
  TF_ASSIGN_OR_RETURN(CertificateFacts facts, ReadCertificate(chain_pem));
  TF_RETURN_IF_ERROR(CheckAuthorities(chain_pem));
  const Key key(PEM_read_bio_PrivateKey(BioOf(key_pem).get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  if (key == nullptr) {
    return absl::InvalidArgumentError("the key file has no private key in PEM without a password");
  }
  const bool fits = X509_check_private_key(FirstCertificate(chain_pem).get(), key.get()) == 1;
  ERR_clear_error();
  if (!fits) {
    return absl::InvalidArgumentError("the key does not belong to the first certificate");
  }
  TF_RETURN_IF_ERROR(CheckDates(facts, now));
  return facts;
}

absl::Status CheckAuthorities(absl::string_view pem) {
  const Bio bio = BioOf(pem);
  int count = 0;
  while (count < kMaxCertificates &&
         Certificate(PEM_read_bio_X509(bio.get(), nullptr, NoPassword, nullptr)) != nullptr) {
    ++count;
  }
  // How reading a good file ends, too.
  const bool at_end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  ERR_clear_error();
  if (count == 0 && at_end) return NoCertificate();
  if (!at_end) {
    return absl::InvalidArgumentError(
        absl::StrCat("certificate ", count + 1, " cannot be read as PEM"));
  }
  return absl::OkStatus();
}

absl::StatusOr<TlsContents> ReadTlsFiles(const TlsFiles& files) {
  if (files.certificate.empty() != files.key.empty()) {
    return absl::InvalidArgumentError("give both certificate and key");
  }
  TlsContents contents;
  if (!files.authorities.empty()) {
    TF_ASSIGN_OR_RETURN(contents.authorities, ReadPemFile(files.authorities));
  }
  if (!files.certificate.empty()) {
    TF_ASSIGN_OR_RETURN(contents.certificate, ReadPemFile(files.certificate));
    TF_ASSIGN_OR_RETURN(contents.key, ReadSecretPemFile(files.key));
  }
  return contents;
}

absl::StatusOr<std::chrono::system_clock::time_point> CheckTlsContents(
    const TlsFiles& files, const TlsContents& contents) {
  if (!files.authorities.empty()) {
    TF_RETURN_IF_ERROR(WithFile(CheckAuthorities(contents.authorities), files.authorities));
  }
  if (files.certificate.empty()) return std::chrono::system_clock::time_point();
  const absl::StatusOr<CertificateFacts> facts =
      CheckIdentity(contents.certificate, contents.key, std::chrono::system_clock::now());
  if (!facts.ok()) return WithFile(facts.status(), files.certificate);
  return facts->not_after;
}

}  // namespace tissueform
