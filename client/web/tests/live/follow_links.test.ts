// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { ConnectError } from "@connectrpc/connect";
import { expect, test, vi } from "vitest";
import { CallError, Code } from "../../src/calls/call_error";
import { FollowLinks, isLinkToken } from "../../src/live/follow_links";

function links(hasLogins: boolean) {
  let count = 0;
  let now = 0;
  const createFollowLink = vi.fn(async () => ({ token: `tfl_${++count}`, expireTime: { seconds: BigInt(now / 1000 + 8 * 3600) } }));
  const deleteFollowLinks = vi.fn(async () => ({}));
  const access = { createFollowLink, deleteFollowLinks } as never;
  const made = new FollowLinks({ access }, hasLogins, "cases/def", () => "sessions/abc", (follow) => `https://p/#follow=${follow}`, () => now);
  return { made, createFollowLink, deleteFollowLinks, sleep: (hours: number) => (now += hours * 3_600_000) };
}

test("without logins the session's name is the link", async () => {
  const { made, createFollowLink } = links(false);
  expect(await made.make()).toEqual({ url: "https://p/#follow=abc", endsAt: null });
  expect(createFollowLink).not.toHaveBeenCalled();
});

test("with logins the link is a token that ends, and not the session's name", async () => {
  const { made, createFollowLink } = links(true);
  const { url, endsAt } = await made.make();
  expect(createFollowLink.mock.calls[0]).toMatchObject([{ session: "sessions/abc", case: "cases/def" }, {}]);
  expect(url).toBe("https://p/#follow=tfl_1");
  expect(endsAt).toEqual(new Date(8 * 3_600_000));
  expect(isLinkToken("tfl_1")).toBe(true);
  expect(isLinkToken("abc")).toBe(false);
});

test("a link is given again while it lasts", async () => {
  const { made, createFollowLink, sleep } = links(true);
  await made.make();
  sleep(6);
  expect((await made.make()).url).toContain("tfl_1");
  sleep(1.5);
  expect((await made.make()).url).toContain("tfl_2");
  expect(createFollowLink).toHaveBeenCalledTimes(2);
});

test("links that were ended are not given again", async () => {
  const { made, deleteFollowLinks } = links(true);
  await made.make();
  await made.endAll();
  expect(deleteFollowLinks.mock.calls[0]).toMatchObject([{ session: "sessions/abc" }, {}]);
  expect((await made.make()).url).toContain("tfl_2");
});

test("a refusal by the server is reported as its error", async () => {
  const { made, createFollowLink } = links(true);
  createFollowLink.mockRejectedValue(new ConnectError("too many links", Code.ResourceExhausted));
  await expect(made.make()).rejects.toEqual(new CallError(Code.ResourceExhausted, "too many links"));
});
