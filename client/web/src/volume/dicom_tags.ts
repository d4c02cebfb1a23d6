// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type dicomParser from "dicom-parser";

export const CT_IMAGE_CLASS = "1.2.840.10008.5.1.4.1.1.2";

/** Decimal numbers of a text; null unless there are `count`. */
export function numbersOf(text: string, count: number): number[] | null {
  const parts = text.split("\\").map((part) => part.trim());
  if (parts.length !== count || !parts.every((part) => /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(part))) return null;
  const numbers = parts.map(Number);
  return numbers.every(Number.isFinite) ? numbers : null;
}

/** Seconds of a date (YYYYMMDD, which may be missing) and a time (HHMMSS.f, of which all but the hours may be); null without hours. */
function secondsAt(date: string, time: string): number | null {
  const clock = /^(\d\d)(\d\d)?(\d\d)?(\.\d{1,6})?/.exec(time);
  if (clock === null) return null;
  const [hours, minutes = 0, seconds = 0, fraction = 0] = clock.slice(1).map((part) => (part === undefined ? undefined : Number(part)));
  const day = /^(\d{4})(\d\d)(\d\d)/.exec(date);
  const dayS = day === null ? 0 : Date.UTC(Number(day[1]), Number(day[2]) - 1, Number(day[3])) / 1000;
  return dayS + 3600 * Number(hours) + 60 * minutes + seconds + fraction;
}

/** Elements of a data set by their tags, "x0020000d". What is missing or malformed is "" or null. */
export class Tags {
  constructor(private readonly data: dicomParser.DataSet) {}

  text(tag: string): string {
    return this.data.elements[tag] ? (this.data.string(tag) ?? "").replace(/\0+$/, "").trim() : "";
  }

  short(tag: string): number {
    const element = this.data.elements[tag];
    return element && element.length >= 2 ? (this.data.uint16(tag) ?? 0) : 0;
  }

  numbers(tag: string, count: number): number[] | null {
    return numbersOf(this.text(tag), count);
  }

  number(tag: string): number | null {
    return this.numbers(tag, 1)?.[0] ?? null;
  }

  integer(tag: string): number | null {
    const text = this.text(tag);
    return /^[+-]?\d{1,9}$/.test(text) ? Number(text) : null;
  }

  /** Of a date and a time, from some day. */
  seconds(dateTag: string, timeTag: string): number | null {
    return secondsAt(this.text(dateTag), this.text(timeTag));
  }

  /** Of a date with its time. */
  secondsOfBoth(tag: string): number | null {
    const text = this.text(tag);
    return secondsAt(text.slice(0, 8), text.slice(8));
  }

  /** The items of a sequence; none where it is missing. */
  items(tag: string): Tags[] {
    return (this.data.elements[tag]?.items ?? []).flatMap(({ dataSet }) => (dataSet === undefined ? [] : [new Tags(dataSet)]));
  }
}
