# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Prints, as JSON, what scipy and numpy compute from the samples of a JSON file. Exit code 77: they are missing."""

import json
import sys

try:
    import numpy
    import scipy.stats
except ImportError:
    sys.exit(77)


def statistics(sample):
    values = numpy.array(sample)
    others = values[values != 0]
    exact = len(others) == len(values) and len(values) <= 25 and len(set(abs(values))) == len(values)
    test = scipy.stats.wilcoxon(values, zero_method="wilcox", correction=False, mode="exact" if exact else "approx")
    resampled = scipy.stats.bootstrap((values,), numpy.mean, n_resamples=20000, method="percentile", random_state=1)
    return {
        "mean": values.mean(),
        "sd": values.std(ddof=1),
        "median": float(numpy.median(values)),
        "p90": float(numpy.percentile(values, 90, method="inverted_cdf")),
        "rank_sum": float(test.statistic),
        "p": float(test.pvalue),
        "exact": exact,
        "low": float(resampled.confidence_interval.low),
        "high": float(resampled.confidence_interval.high),
        "standard_error": float(resampled.standard_error),
    }


with open(sys.argv[1], encoding="utf-8") as file:
    json.dump([statistics(sample) for sample in json.load(file)], sys.stdout)
