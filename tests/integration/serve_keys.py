# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A provider's key server, as Python's standard library makes one: serves the files of a folder on a free port of
loopback, and some paths that a careful client must get over. Says `listening on HOST:PORT`.

  serve_keys.py FOLDER
"""

import functools
import http.server
import sys
import threading


class Keys(http.server.SimpleHTTPRequestHandler):
    def do_GET(self):
        if self.path == "/elsewhere":
            self.send_response(302)
            self.send_header("Location", "/jwks.json")
            self.end_headers()
        elif self.path == "/without_end":
            self.send_response(200)
            self.end_headers()
            try:
                while True:
                    self.wfile.write(b" " * 65536)
            except OSError:
                pass
        elif self.path == "/silent":
            threading.Event().wait()
        else:
            super().do_GET()

    def log_message(self, *_):
        pass


def main():
    handler = functools.partial(Keys, directory=sys.argv[1])
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        server.daemon_threads = True
        print(f"listening on 127.0.0.1:{server.server_address[1]}", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    main()
