// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type ChildProcess, spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { type AddressInfo, connect, createServer } from "node:net";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const CONFIGURATION = fileURLToPath(new URL("../../deploy/haproxy/cluster.cfg", import.meta.url));
const HAPROXY = ["/usr/sbin/haproxy", "/usr/bin/haproxy"].find((path) => existsSync(path));
const START_MS = 20_000;
const ASK_AGAIN_MS = 50;

export const hasHaproxy = HAPROXY !== undefined;

/** "127.0.0.1:PORT" at which no process listens. */
export async function freeAddress(): Promise<string> {
  const server = createServer();
  await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
  const { port } = server.address() as AddressInfo;
  await new Promise((done) => server.close(done));
  return `127.0.0.1:${port}`;
}

/** deploy/haproxy/cluster.cfg as it stands, before servers and gateways: what browsers see of a cluster, and where gateways call. */
export class Front {
  private constructor(
    private readonly child: ChildProcess,
    private readonly socket: string,
    readonly url: string,
    readonly calls: string,
  ) {}

  /** Before servers and gateways at these addresses, which may come later; `folder`: for its runtime socket. */
  static async start(folder: string, servers: Map<string, string>, gateways: string[]): Promise<Front> {
    const [listen, web, calls] = [await freeAddress(), await freeAddress(), await freeAddress()];
    const socket = join(folder, "haproxy.sock");
    const nodes = [...servers].flatMap(([name, address], index) => [
      [`TISSUEFORM_NODE_${index + 1}`, name],
      [`TISSUEFORM_SERVER_${index + 1}`, address],
    ]);
    const named = gateways.map((address, index) => [`TISSUEFORM_GATEWAY_${index + 1}`, address]);
    const places = { TISSUEFORM_LISTEN: listen, TISSUEFORM_LISTEN_WEB: web, TISSUEFORM_LISTEN_GATEWAYS: calls, TISSUEFORM_SOCKET: socket };
    const variables = { ...places, ...Object.fromEntries([...nodes, ...named]) };
    const child = spawn(HAPROXY ?? "haproxy", ["-db", "-f", CONFIGURATION], { stdio: "ignore", env: { ...process.env, ...variables } });
    return new Front(child, socket, `http://${web}`, calls);
  }

  /** Until it sends calls to so many servers, or pages to so many gateways. */
  async has(count: number, what: "servers" | "gateways"): Promise<void> {
    const end = Date.now() + START_MS;
    const up = new RegExp(`^${what},(?!BACKEND).*,UP,`, "gm");
    let reply = "";
    while ((reply.match(up) ?? []).length !== count) {
      if (Date.now() > end) throw new Error(`HAProxy does not see ${count} ${what}: ${reply}`);
      await new Promise((done) => setTimeout(done, ASK_AGAIN_MS));
      reply = await this.ask("show stat");
    }
  }

  async stop(): Promise<void> {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    const ended = new Promise((accept) => this.child.once("exit", accept));
    this.child.kill("SIGTERM");
    await ended;
  }

  /** "" where it does not answer. */
  private ask(words: string): Promise<string> {
    return new Promise((accept) => {
      let reply = "";
      const connection = connect(this.socket, () => connection.write(`${words}\n`));
      connection.on("data", (data) => (reply += data.toString()));
      connection.on("error", () => accept(""));
      connection.on("close", () => accept(reply));
    });
  }
}
