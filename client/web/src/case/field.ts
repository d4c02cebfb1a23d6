// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** What is wrong with a case file, as a sentence without its full stop. */
export class CaseError extends Error {}

const MAX_TEXT = 1024;

/**
 * A value of a file's JSON with the way to it, checked step by step: each reader throws a CaseError that names the place
 * ("handles[0].pivot_mm") and says what was expected there.
 */
export class Field {
  constructor(
    private readonly value: unknown,
    private readonly path: string,
  ) {}

  get isPresent(): boolean {
    return this.value !== undefined && this.value !== null;
  }

  /** The member `name` of an object; it need not be there. */
  get(name: string): Field {
    if (typeof this.value !== "object" || this.value === null || Array.isArray(this.value)) this.fail("an object");
    const members = this.value as Record<string, unknown>;
    return new Field(Object.hasOwn(members, name) ? members[name] : undefined, this.path === "" ? name : `${this.path}.${name}`);
  }

  /** The entries of an array of at most `most`. */
  list(most: number): Field[] {
    if (!Array.isArray(this.value)) this.fail("a list");
    const values = this.value as unknown[];
    if (values.length > most) this.fail(`a list of at most ${most} entries`);
    return values.map((value, index) => new Field(value, `${this.path}[${index}]`));
  }

  text(): string {
    if (typeof this.value !== "string" || this.value.length > MAX_TEXT) this.fail("a text");
    return this.value as string;
  }

  textOr(other: string): string {
    return this.isPresent ? this.text() : other;
  }

  oneOf<T extends string>(choices: readonly T[]): T {
    if (!choices.includes(this.value as T)) this.fail(`one of ${choices.join(", ")}`);
    return this.value as T;
  }

  number(): number {
    if (typeof this.value !== "number" || !Number.isFinite(this.value)) this.fail("a number");
    return this.value as number;
  }

  /** A whole number from `least` to `most`. */
  integer(least: number, most: number): number {
    if (!Number.isSafeInteger(this.value) || (this.value as number) < least || (this.value as number) > most) {
      this.fail(`a whole number from ${least} to ${most}`);
    }
    return this.value as number;
  }

  integerOr(other: number, least: number, most: number): number {
    return this.isPresent ? this.integer(least, most) : other;
  }

  truth(): boolean {
    if (typeof this.value !== "boolean") this.fail("true or false");
    return this.value as boolean;
  }

  vector(): [number, number, number] {
    const entries = this.list(3);
    if (entries.length !== 3) this.fail("three numbers");
    return [entries[0].number(), entries[1].number(), entries[2].number()];
  }

  fail(expected: string): never {
    throw new CaseError(`the case's ${this.path === "" ? "JSON" : this.path} is not ${expected}: make the file again with tissueform case pack`);
  }
}
