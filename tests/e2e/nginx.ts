// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type ChildProcess, execFileSync, spawn } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { connect } from "node:net";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { freeAddress } from "./front";

const PAGE = fileURLToPath(new URL("../../docs/gateway.md", import.meta.url));
const NGINX = ["/usr/sbin/nginx", "/usr/bin/nginx"].find((path) => existsSync(path));
const START_MS = 20_000;
const ASK_AGAIN_MS = 50;

export const hasNginx = NGINX !== undefined;

/** The configuration that docs/gateway.md gives. */
export function documentedConfiguration(): string {
  const block = /```nginx\n([^]*?)```/.exec(readFileSync(PAGE, "utf8"));
  if (block === null) throw new Error("docs/gateway.md has no configuration of nginx");
  return block[1];
}

/** Every one of these texts is replaced, and must stand there once. */
export function replaced(text: string, changes: Record<string, string>): string {
  for (const [from, to] of Object.entries(changes)) {
    if (text.split(from).length !== 2) throw new Error(`the configuration has not once: ${from}`);
    text = text.replace(from, () => to);
  }
  return text;
}

/** nginx on loopback with a configuration that is made of the documented one; all that it writes lies in `folder`. */
export class Nginx {
  private constructor(
    private readonly child: ChildProcess,
    /** "127.0.0.1:PORT" */
    readonly address: string,
  ) {}

  /** Before the gateway at `gateway` ("127.0.0.1:PORT"). `changes`: further ones. */
  static async start(folder: string, gateway: string, changes: Record<string, string> = {}): Promise<Nginx> {
    mkdirSync(folder, { recursive: true });
    const [key, certificate, address] = [join(folder, "key.pem"), join(folder, "certificate.pem"), await freeAddress()];
    const subject = ["-subj", "/CN=hospital.example.org", "-addext", "subjectAltName=DNS:hospital.example.org"];
    execFileSync("openssl", ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", ...subject, "-keyout", key, "-out", certificate], { stdio: "ignore" });
    const own = { "listen 443 ssl": `listen ${address} ssl`, "/etc/ssl/planner.pem": certificate, "/etc/ssl/planner.key": key, "http://127.0.0.1:8080/": `http://${gateway}/` };
    writeFileSync(join(folder, "planner.conf"), replaced(documentedConfiguration(), { ...own, ...changes }));
    const paths = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"].map((name) => `${name}_temp_path ${join(folder, name)};`);
    const http = `http { access_log off; ${paths.join(" ")} include ${join(folder, "planner.conf")}; }`;
    writeFileSync(join(folder, "nginx.conf"), `daemon off; master_process off; pid ${join(folder, "pid")}; error_log ${join(folder, "errors")}; events {} ${http}`);
    const child = spawn(NGINX ?? "nginx", ["-p", folder, "-e", join(folder, "errors"), "-c", join(folder, "nginx.conf")], { stdio: "ignore" });
    const nginx = new Nginx(child, address);
    await nginx.listens(join(folder, "errors"));
    return nginx;
  }

  async stop(): Promise<void> {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    const ended = new Promise((accept) => this.child.once("exit", accept));
    this.child.kill("SIGTERM");
    await ended;
  }

  private async listens(errors: string): Promise<void> {
    const end = Date.now() + START_MS;
    while (!(await this.takesConnections())) {
      if (this.child.exitCode !== null || Date.now() > end) throw new Error(`nginx does not listen: ${existsSync(errors) ? readFileSync(errors, "utf8") : ""}`);
      await new Promise((done) => setTimeout(done, ASK_AGAIN_MS));
    }
  }

  private takesConnections(): Promise<boolean> {
    const [host, port] = this.address.split(":");
    return new Promise((accept) => {
      const socket = connect({ host, port: Number(port) }, () => {
        socket.destroy();
        accept(true);
      });
      socket.on("error", () => accept(false));
    });
  }
}
