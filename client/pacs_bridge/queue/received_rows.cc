// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/received_rows.h"

#include <optional>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

#define TF_IMAGE_COUNT "(SELECT COUNT(*) FROM images WHERE images.series = series.key)"
#define TF_SERIES_FIELDS                                                                          \
  "SELECT key, study_uid, uid, frame_uid, modality, state, reason, recipe, case_name, attempts, " \
  "last_error, first_s, done_s, has_files, has_header, "
#define TF_SERIES_COLUMNS TF_SERIES_FIELDS TF_IMAGE_COUNT " FROM series "

// States of a series of which nothing was made yet: more images may change what is.
#define TF_NOT_BUILT "('incomplete', 'complete', 'passed_over', 'chosen', 'drafting')"

absl::Status InsertStudy(Database& database, const QueuedStudy& study) {
  return database.Prepare("INSERT OR IGNORE INTO studies VALUES (?, ?, ?, ?, ?, ?, ?, ?)")
      .Bind(study.uid)
      .Bind(study.patient.id)
      .Bind(study.patient.issuer)
      .Bind(study.patient.name)
      .Bind(study.patient.birth_date)
      .Bind(int64_t{study.patient.readable})
      .Bind(study.date)
      .Bind(study.description)
      .Run();
}

absl::Status InsertSeries(Database& database, const QueuedSeries& series, const std::string& key) {
  return database
      .Prepare("INSERT OR IGNORE INTO series VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, 0, '', ?, 0, 1, 0)")
      .Bind(key)
      .Bind(series.study_uid)
      .Bind(series.uid)
      .Bind(series.frame_uid)
      .Bind(series.modality)
      .Bind(SeriesStateName(SeriesState::kReceiving))
      .Bind(series.reason)
      .Bind(series.recipe)
      .Bind(series.case_name)
      .Bind(series.first_s)
      .Run();
}

// True when it, or its file, was not there.
absl::StatusOr<bool> InsertImage(Database& database, const std::string& series,
                                 const QueuedImage& image) {
  const int64_t before = database.total_changes();
  TF_RETURN_IF_ERROR(
      database
          .Prepare("INSERT INTO images VALUES (?, ?, ?, ?) ON CONFLICT (series, uid) "
                   "DO UPDATE SET file = excluded.file WHERE images.file = ''")
          .Bind(series)
          .Bind(image.uid)
          .Bind(image.class_uid)
          .Bind(image.file)
          .Run());
  return database.total_changes() > before;
}

// Cases of earlier plans stay known: there are predictions of them.
absl::Status KeepCase(Database& database, const QueuedSeries& series) {
  if (series.case_name.empty()) return absl::OkStatus();
  return database
      .Prepare("INSERT OR IGNORE INTO cases SELECT ?, key, " TF_IMAGE_COUNT
               " FROM series WHERE key = ?")
      .Bind(series.case_name)
      .Bind(series.key)
      .Run();
}

absl::StatusOr<std::vector<QueuedImage>> ReadImages(BridgeQueue* queue, const char* sql,
                                                    const std::string& value) {
  std::vector<QueuedImage> images;
  const absl::Status done = queue->Read([&](Database& database) -> absl::Status {
    Database::Query row = database.Prepare(sql);
    row.Bind(value);
    for (;;) {
      TF_ASSIGN_OR_RETURN(const bool found, row.Step());
      if (!found) return absl::OkStatus();
      images.push_back({TextOf(row, 0), TextOf(row, 1), TextOf(row, 2), TextOf(row, 3)});
    }
  });
  TF_RETURN_IF_ERROR(done);
  return images;
}

absl::StatusOr<std::optional<QueuedSeries>> FindSeries(Database& database, const char* sql,
                                                       const std::string& value) {
  Database::Query query = database.Prepare(sql);
  query.Bind(value);
  TF_ASSIGN_OR_RETURN(const bool row, query.Step());
  if (!row) return std::nullopt;
  TF_ASSIGN_OR_RETURN(QueuedSeries series, SeriesOf(query));
  return std::optional<QueuedSeries>(std::move(series));
}

constexpr char kByKey[] = TF_SERIES_COLUMNS "WHERE key = ?";
constexpr char kByUid[] = TF_SERIES_COLUMNS "WHERE uid = ?";
constexpr char kByCase[] =
    TF_SERIES_COLUMNS "WHERE key = (SELECT series FROM cases WHERE name = ?)";
constexpr char kOfStudy[] = TF_SERIES_COLUMNS "WHERE study_uid = ? ORDER BY first_s, key";
// Counting images takes as long as there are images.
constexpr char kOfState[] = TF_SERIES_FIELDS "0 FROM series WHERE state = ? ORDER BY first_s, key";
constexpr char kAll[] = TF_SERIES_COLUMNS "WHERE ? = '' ORDER BY first_s, key";

}  // namespace

absl::StatusOr<QueuedSeries> ReceivedRows::Add(const QueuedStudy& study, const QueuedSeries& series,
                                               const std::string& new_key,
                                               const std::vector<QueuedImage>& images) {
  QueuedSeries kept;
  const absl::Status done = queue_->Change([&](Database& database) -> absl::Status {
    TF_RETURN_IF_ERROR(InsertStudy(database, study));
    TF_RETURN_IF_ERROR(InsertSeries(database, series, new_key));
    TF_ASSIGN_OR_RETURN(std::optional<QueuedSeries> found,
                        FindSeries(database, kByUid, series.uid));
    if (!found.has_value() || found->study_uid != series.study_uid) {
      return absl::FailedPreconditionError("a series belongs to another study; check its sender");
    }
    bool any_new = false;
    for (const QueuedImage& image : images) {
      TF_ASSIGN_OR_RETURN(const bool is_new, InsertImage(database, found->key, image));
      any_new = any_new || is_new;
    }
    if (any_new) {
      TF_RETURN_IF_ERROR(
          database
              .Prepare("UPDATE series SET has_files = 1, done_s = CASE WHEN state IN " TF_NOT_BUILT
                       " THEN 0 ELSE done_s END, state = CASE WHEN state IN " TF_NOT_BUILT
                       " THEN 'receiving' ELSE state END WHERE key = ?")
              .Bind(found->key)
              .Run());
    }
    TF_ASSIGN_OR_RETURN(found, FindSeries(database, kByUid, series.uid));
    kept = *std::move(found);
    return absl::OkStatus();
  });
  TF_RETURN_IF_ERROR(done);
  return kept;
}

absl::Status ReceivedRows::Update(const QueuedSeries& series) {
  return queue_->Change([&](Database& database) -> absl::Status {
    const int64_t before = database.total_changes();
    TF_RETURN_IF_ERROR(
        database
            .Prepare(
                "UPDATE series SET modality = ?, state = ?, reason = ?, recipe = ?, case_name = ?, "
                "attempts = ?, last_error = ?, done_s = ?, has_files = ?, has_header = ? "
                "WHERE key = ?")
            .Bind(series.modality)
            .Bind(SeriesStateName(series.state))
            .Bind(series.reason)
            .Bind(series.recipe)
            .Bind(series.case_name)
            .Bind(series.attempts)
            .Bind(series.last_error)
            .Bind(series.done_s)
            .Bind(int64_t{series.has_files})
            .Bind(int64_t{series.has_header})
            .Bind(series.key)
            .Run());
    if (database.total_changes() > before) return KeepCase(database, series);
    return absl::NotFoundError(absl::StrCat("no series ", series.key, " in the queue"));
  });
}

absl::Status ReceivedRows::UpdateStep(const QueuedSeries& series, SeriesState before) {
  return queue_->Change([&](Database& database) -> absl::Status {
    const int64_t changes = database.total_changes();
    TF_RETURN_IF_ERROR(
        database
            .Prepare("UPDATE series SET state = ?, case_name = ?, attempts = ?, last_error = ?, "
                     "done_s = ? WHERE key = ? AND state = ? AND (state NOT IN ('chosen', "
                     "'drafting') OR " TF_IMAGE_COUNT " = ?)")
            .Bind(SeriesStateName(series.state))
            .Bind(series.case_name)
            .Bind(series.attempts)
            .Bind(series.last_error)
            .Bind(series.done_s)
            .Bind(series.key)
            .Bind(SeriesStateName(before))
            .Bind(series.images)
            .Run());
    if (database.total_changes() > changes) return KeepCase(database, series);
    return absl::AbortedError("more images have arrived");
  });
}

absl::StatusOr<bool> ReceivedRows::Remark(const std::string& key, const std::string& remark) {
  bool is_new = false;
  const absl::Status done = queue_->Change([&](Database& database) -> absl::Status {
    const int64_t changes = database.total_changes();
    TF_RETURN_IF_ERROR(
        database
            .Prepare("UPDATE series SET reason = CASE WHEN reason = '' THEN ?1 ELSE reason || '; ' "
                     "|| ?1 END WHERE key = ?2 AND instr(reason, ?1) = 0")
            .Bind(remark)
            .Bind(key)
            .Run());
    is_new = database.total_changes() > changes;
    return absl::OkStatus();
  });
  TF_RETURN_IF_ERROR(done);
  return is_new;
}

absl::StatusOr<QueuedSeries> ReceivedRows::SelectOne(const char* sql, const std::string& value) {
  std::optional<QueuedSeries> found;
  const absl::Status done = queue_->Read([&](Database& database) -> absl::Status {
    TF_ASSIGN_OR_RETURN(found, FindSeries(database, sql, value));
    return absl::OkStatus();
  });
  TF_RETURN_IF_ERROR(done);
  if (!found.has_value()) {
    return absl::NotFoundError("no such series in the queue; `tissueform-pacs series` lists them");
  }
  return *std::move(found);
}

absl::StatusOr<std::vector<QueuedSeries>> ReceivedRows::Select(const char* sql,
                                                               const std::string& value) {
  std::vector<QueuedSeries> all;
  const absl::Status done = queue_->Read([&](Database& database) -> absl::Status {
    Database::Query query = database.Prepare(sql);
    query.Bind(value);
    for (;;) {
      TF_ASSIGN_OR_RETURN(const bool row, query.Step());
      if (!row) return absl::OkStatus();
      TF_ASSIGN_OR_RETURN(all.emplace_back(), SeriesOf(query));
    }
  });
  TF_RETURN_IF_ERROR(done);
  return all;
}

absl::StatusOr<QueuedSeries> ReceivedRows::Get(const std::string& key) {
  return SelectOne(kByKey, key);
}

absl::StatusOr<QueuedSeries> ReceivedRows::GetByUid(const std::string& uid) {
  return SelectOne(kByUid, uid);
}

absl::StatusOr<QueuedSeries> ReceivedRows::GetByCase(const std::string& case_name) {
  return SelectOne(kByCase, case_name);
}

absl::StatusOr<std::vector<QueuedSeries>> ReceivedRows::List() { return Select(kAll, ""); }

absl::StatusOr<std::vector<QueuedSeries>> ReceivedRows::ListOfState(SeriesState state) {
  return Select(kOfState, SeriesStateName(state));
}

absl::StatusOr<std::vector<QueuedSeries>> ReceivedRows::ListStudy(const std::string& study_uid) {
  return Select(kOfStudy, study_uid);
}

absl::StatusOr<QueuedStudy> ReceivedRows::GetStudy(const std::string& uid) {
  QueuedStudy study;
  const absl::Status done = queue_->Read([&](Database& database) -> absl::Status {
    Database::Query row = database.Prepare(
        "SELECT uid, patient_id, issuer, name, birth_date, readable, study_date, "
        "description FROM studies WHERE uid = ?");
    row.Bind(uid);
    TF_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return absl::NotFoundError("no such study in the queue");
    study = {.uid = TextOf(row, 0),
             .patient = {.id = TextOf(row, 1),
                         .issuer = TextOf(row, 2),
                         .name = TextOf(row, 3),
                         .birth_date = TextOf(row, 4),
                         .readable = row.Integer(5) != 0},
             .date = TextOf(row, 6),
             .description = TextOf(row, 7)};
    return absl::OkStatus();
  });
  TF_RETURN_IF_ERROR(done);
  return study;
}

absl::StatusOr<std::vector<QueuedImage>> ReceivedRows::ListImages(const std::string& series) {
  return ReadImages(queue_,
                    "SELECT series, uid, class_uid, file FROM images WHERE series = ? ORDER BY uid",
                    series);
}

absl::StatusOr<std::vector<QueuedImage>> ReceivedRows::ListSources(const std::string& case_name) {
  // Rows are numbered as they come.
  return ReadImages(queue_,
                    "SELECT * FROM (SELECT series, uid, class_uid, file FROM images WHERE series = "
                    "(SELECT series FROM cases WHERE name = ?1) ORDER BY rowid "
                    "LIMIT (SELECT images FROM cases WHERE name = ?1)) ORDER BY uid",
                    case_name);
}

absl::Status ReceivedRows::Forget(const std::string& series) {
  return queue_->Change([&](Database& database) -> absl::Status {
    TF_RETURN_IF_ERROR(database.Prepare("DELETE FROM images WHERE series = ?").Bind(series).Run());
    TF_RETURN_IF_ERROR(database.Prepare("DELETE FROM cases WHERE series = ?").Bind(series).Run());
    TF_RETURN_IF_ERROR(database.Prepare("DELETE FROM drafts WHERE series = ?").Bind(series).Run());
    TF_RETURN_IF_ERROR(database.Prepare("DELETE FROM series WHERE key = ?").Bind(series).Run());
    return database.Execute("DELETE FROM studies WHERE uid NOT IN (SELECT study_uid FROM series)");
  });
}

absl::Status ReceivedRows::ForgetFiles(const std::string& series) {
  return queue_->Change([&](Database& database) -> absl::Status {
    TF_RETURN_IF_ERROR(
        database.Prepare("UPDATE images SET file = '' WHERE series = ?").Bind(series).Run());
    return database.Prepare("UPDATE series SET has_files = 0 WHERE key = ?").Bind(series).Run();
  });
}

}  // namespace tissueform
