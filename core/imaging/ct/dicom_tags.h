// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <Eigen/Core>

namespace gdcm {
class DataSet;
}

namespace tissueform {

// Values of DICOM's tags, such as 0x00280010 for (0028,0010). They are taken as text and read
// strictly: a header may hold anything. In a helper program only. Internal to core/imaging/ct.

// Without spaces and zeros about it; empty if the tag is missing.
std::string TextOf(const gdcm::DataSet& data, uint32_t tag);

// A tag of type US; 0 if the tag is missing.
int ShortOf(const gdcm::DataSet& data, uint32_t tag);

std::optional<int> IntegerOf(const gdcm::DataSet& data, uint32_t tag);

// `count` finite numbers with backslashes between them, or nothing.
std::optional<Eigen::VectorXd> NumbersOf(const gdcm::DataSet& data, uint32_t tag, int count);

std::optional<double> NumberOf(const gdcm::DataSet& data, uint32_t tag);

// Seconds from some day to a date (DA) and time (TM) of two tags, or to a DT in one; none where
// there is no time.
std::optional<double> SecondsOf(const gdcm::DataSet& data, uint32_t date_tag, uint32_t time_tag);
std::optional<double> SecondsOf(const gdcm::DataSet& data, uint32_t date_time_tag);

// Calls visit for the items of a sequence in their order; returns their number.
int ForEachItem(const gdcm::DataSet& data, uint32_t tag,
                const std::function<void(int index, const gdcm::DataSet& item)>& visit);

}  // namespace tissueform
