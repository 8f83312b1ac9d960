// SPDX-License-Identifier: Apache-2.0
// Every line of the server's list of who gets nothing, with raw sockets.
#include "framework/view/http_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <fstream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

namespace {

/// A connection that says what it likes.
class RawSocket {
 public:
  explicit RawSocket(int port) : RawSocket(Family{AF_INET}) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(connect_to(&address, sizeof address));
  }
  /// By ::1; empty on machines without IPv6.
  static std::unique_ptr<RawSocket> by_ipv6(int port) {
    std::unique_ptr<RawSocket> made(new RawSocket(Family{AF_INET6}));
    sockaddr_in6 address{};
    address.sin6_family = AF_INET6;
    address.sin6_port = htons(static_cast<std::uint16_t>(port));
    address.sin6_addr = in6addr_loopback;
    return made->connect_to(&address, sizeof address) ? std::move(made) : nullptr;
  }
  ~RawSocket() { close(socket_); }
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;

  void send(const std::string& text) const {
    ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
  }
  /// All until the other side closes; nothing when it keeps the connection for long.
  std::optional<std::string> read_all() const {
    std::string text;
    char part[4096];
    for (;;) {
      const ssize_t count = recv(socket_, part, sizeof part, 0);
      if (count == 0) return text;
      if (count < 0) return errno == ECONNRESET ? std::optional(text) : std::nullopt;
      text.append(part, std::size_t(count));
    }
  }
  /// Up to the end of a header.
  std::string read_header() const {
    std::string text;
    char byte = 0;
    while (!text.ends_with("\r\n\r\n") && recv(socket_, &byte, 1, 0) == 1) text += byte;
    return text;
  }

 private:
  struct Family {
    int number;
  };
  explicit RawSocket(Family family) : socket_(socket(family.number, SOCK_STREAM, 0)) {
    const timeval patience{20, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  bool connect_to(const void* address, socklen_t size) const {
    return connect(socket_, static_cast<const sockaddr*>(address), size) == 0;
  }

  int socket_;
};

/// A server that repeats paths, and a client that knows the token.
struct Served {
  explicit Served(HttpServer::Options options = {})
      : server(options, [](std::string_view path) {
          if (path == "/fault") throw std::runtime_error("<b>nothing</b>");
          HttpAnswer answer;
          answer.body = std::make_shared<const std::string>("path " + std::string(path));
          return answer;
        }) {
    const std::string address = server.address();
    token = address.substr(address.find("?token=") + 7);
    const std::string hello = request("GET", "/?token=" + token, "");
    const std::size_t at = hello.find("Set-Cookie: ");
    REQUIRE(at != hello.npos);
    cookie = "Cookie: " + hello.substr(at + 12, hello.find(';', at) - at - 12) + "\r\n";
  }

  std::string raw(const std::string& text) const {
    const RawSocket socket(server.port());
    socket.send(text);
    return socket.read_all().value_or("no end");
  }
  std::string request(const std::string& method, const std::string& target,
                      const std::string& headers) const {
    return raw(method + " " + target + " HTTP/1.1\r\nHost: localhost:" +
               std::to_string(server.port()) + "\r\nConnection: close\r\n" + headers + "\r\n");
  }
  std::string get(const std::string& target, const std::string& headers = "") const {
    return request("GET", target, cookie + headers);
  }

  HttpServer server;
  std::string token;
  std::string cookie;
};

bool has_status(const std::string& answer, int status) {
  return answer.starts_with("HTTP/1.1 " + std::to_string(status) + " ");
}

}  // namespace

TEST_CASE("Who knows the token is served, with headers that keep the page to itself", "[view]") {
  const Served served;
  CHECK(served.token.size() == 32);
  const std::string hello = served.request("GET", "/?token=" + served.token, "");
  CHECK(has_status(hello, 200));
  CHECK(hello.ends_with("\r\n\r\npath /"));
  CHECK(hello.find(served.token) == hello.rfind(served.token));
  CHECK(hello.find("; Path=/; HttpOnly; SameSite=Strict\r\n") != hello.npos);
  const std::string answer = served.get("/a/1");
  CHECK(has_status(answer, 200));
  CHECK(answer.ends_with("\r\n\r\npath /a/1"));
  for (const char* header :
       {"X-Content-Type-Options: nosniff", "Referrer-Policy: no-referrer",
        "Cache-Control: no-store", "Cross-Origin-Resource-Policy: same-origin",
        "Cross-Origin-Opener-Policy: same-origin", "X-Frame-Options: DENY",
        "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src "
        "'self' blob:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action "
        "'none'"}) {
    INFO(header);
    CHECK(answer.find(std::string(header) + "\r\n") != answer.npos);
    CHECK(hello.find(std::string(header) + "\r\n") != hello.npos);
  }
  CHECK(answer.find("Access-Control") == answer.npos);
  CHECK(answer.find(served.token) == answer.npos);
}

TEST_CASE("Without the token there is nothing, not even which pages exist", "[view]") {
  const Served served;
  const std::string name = served.cookie.substr(0, served.cookie.find('=') + 1);
  for (const std::string& headers :
       {std::string(), name + "\r\n", name + served.token.substr(1) + "0\r\n",
        "Cookie: other=" + served.token + "\r\n", served.cookie + served.cookie}) {
    for (const char* target : {"/", "/a", "/fault"}) {
      INFO(headers << target);
      CHECK(has_status(served.request("GET", target, headers), 403));
    }
  }
  for (const std::string& target : {std::string("/?token="), "/?token=" + served.token + "0",
                                    "/?token=" + served.token.substr(1),
                                    "/?x=1&token=" + served.token, "/a?token=" + served.token}) {
    INFO(target);
    CHECK(has_status(served.request("GET", target, ""), 403));
  }
}

TEST_CASE("Names that others can point at this machine are refused", "[view]") {
  const Served served;
  const auto with_host = [&](const std::string& host) {
    return served.raw("GET /a HTTP/1.1\r\n" + host + "Connection: close\r\n" + served.cookie +
                      "\r\n");
  };
  for (const char* host : {"localhost", "localhost:8080", "127.0.0.1", "127.0.0.1:1", "[::1]:9"}) {
    INFO(host);
    CHECK(has_status(with_host("Host: " + std::string(host) + "\r\n"), 200));
  }
  for (const char* host :
       {"evil.example", "localhost.evil.example", "127.0.0.1.nip.io", "localhost:80a",
        "localhost:", "127.0.0.2", "0.0.0.0", "a@localhost", "localhost:123456"}) {
    INFO(host);
    CHECK(has_status(with_host("Host: " + std::string(host) + "\r\n"), 403));
  }
  CHECK(has_status(with_host(""), 403));
  CHECK(has_status(with_host("Host: localhost\r\nHost: evil.example\r\n"), 403));
}

TEST_CASE("Other pages get nothing, even with the cookie", "[view]") {
  const Served served;
  const std::string own = "http://localhost:" + std::to_string(served.server.port());
  CHECK(
      has_status(served.get("/a", "Origin: " + own + "\r\nSec-Fetch-Site: same-origin\r\n"), 200));
  CHECK(has_status(served.get("/a", "Sec-Fetch-Site: none\r\n"), 200));
  for (const std::string& header :
       {std::string("Origin: null"), std::string("Origin: https://evil.example"),
        "Origin: " + own + "0", std::string("Origin: http://localhost:1"),
        std::string("Sec-Fetch-Site: cross-site"), std::string("Sec-Fetch-Site: same-site"),
        std::string("Sec-Fetch-Site: none\r\nSec-Fetch-Site: cross-site")}) {
    INFO(header);
    CHECK(has_status(served.get("/a", header + "\r\n"), 403));
  }
}

TEST_CASE("Nothing but GET and HEAD, and no bodies", "[view]") {
  const Served served;
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"}) {
    INFO(method);
    const std::string answer = served.request(method, "/a", served.cookie);
    CHECK(has_status(answer, 405));
    CHECK(answer.find("Allow: GET, HEAD\r\n") != answer.npos);
  }
  const std::string head = served.request("HEAD", "/abc", served.cookie);
  CHECK(has_status(head, 200));
  CHECK(head.find("Content-Length: 9\r\n") != head.npos);
  CHECK(head.ends_with("\r\n\r\n"));
  CHECK(has_status(served.request("GET", "/a", served.cookie + "Content-Length: 5\r\n\r\nabcd"),
                   413));
  CHECK(has_status(served.request("POST", "/a", served.cookie + "Content-Length: 999999999\r\n"),
                   413));
  CHECK(has_status(
      served.request("GET", "/a",
                     served.cookie + "Transfer-Encoding: chunked\r\n\r\n1\r\na\r\n0\r\n"),
      413));
}

TEST_CASE("Addresses are plain words, requests are short", "[view]") {
  const Served served;
  for (const char* target : {"/%2e%2e/etc/passwd", "/a%00", "/a\\b", "/a?b=1", "/a?", "/~", "/a:b",
                             "http://evil.example/", "*", "a"}) {
    INFO(target);
    CHECK_FALSE(has_status(served.get(target), 200));
  }
  CHECK(has_status(served.get("/" + std::string(255, 'a')), 200));
  CHECK(has_status(served.get("/" + std::string(256, 'a')), 414));
  CHECK(has_status(served.get("/a", "X: " + std::string(9000, 'x') + "\r\n"), 431));
  for (const char* noise : {"\r\n\r\n\r\n", "GET\r\n\r\n", "\x16\x03\x01\x02\r\n\r\n",
                            "GET / HTTP/9.9\r\n\r\n", "GET /a HTTP/1.1\r\nno colon\r\n\r\n"}) {
    const std::string answer = served.raw(noise);
    INFO(noise << answer);
    CHECK(answer.find(" 200 ") == answer.npos);
    CHECK(answer != "no end");
  }
  // What goes wrong inside is plain text, whatever it holds.
  const std::string fault = served.get("/fault");
  CHECK(has_status(fault, 500));
  CHECK(fault.find("Content-Type: text/plain; charset=utf-8\r\n") != fault.npos);
  CHECK(fault.ends_with("<b>nothing</b>\n"));
}

TEST_CASE("It listens on loopback addresses and nowhere else", "[view]") {
  const Served served;
  char port[8];
  std::snprintf(port, sizeof port, ":%04X", unsigned(served.server.port()));
  int listening = 0;
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream lines(table);
    for (std::string line; std::getline(lines, line);) {
      const std::string local =
          line.substr(line.find(':') + 2, line.find(' ', line.find(':') + 2) - line.find(':') - 2);
      const bool listens = line.find(" 0A ") != line.npos;
      if (!listens || !local.ends_with(port)) continue;
      ++listening;
      INFO(line);
      CHECK((local.starts_with("0100007F:") ||
             local.starts_with("00000000000000000000000001000000:")));
    }
  }
  CHECK(listening >= 1);
  // Browsers may take ::1 for localhost: the same rules hold there.
  for (const auto& [headers, status] : {std::pair(std::string(), 403), {served.cookie, 200}}) {
    const auto by_ipv6 = RawSocket::by_ipv6(served.server.port());
    CHECK((listening == 2) == (by_ipv6 != nullptr));
    if (!by_ipv6) break;
    by_ipv6->send("GET /a HTTP/1.1\r\nHost: [::1]\r\n" + headers + "\r\n");
    CHECK(has_status(by_ipv6->read_header(), status));
  }
  HttpServer::Options taken;
  taken.port = served.server.port();
  CHECK_THROWS_WITH(HttpServer(taken, [](std::string_view) { return HttpAnswer(); }),
                    ContainsSubstring("--port 0 takes one that is free"));
}

TEST_CASE("Slow and surplus connections are closed, others go on", "[view]") {
  HttpServer::Options options;
  options.request_time = std::chrono::seconds(1);
  options.connections = 3;
  const Served served(options);
  // Half a request, and silence.
  const RawSocket slow(served.server.port());
  slow.send("GET /a HTTP/1.1\r\nHost: localhost\r\n");
  const RawSocket kept(served.server.port());
  kept.send("GET /a HTTP/1.1\r\nHost: localhost\r\n" + served.cookie + "\r\n");
  CHECK(has_status(kept.read_header(), 200));
  CHECK(slow.read_all() == "");
  // `kept` has a place; of four more, two find none. Who was closed may be counted a little longer.
  std::vector<std::unique_ptr<RawSocket>> more;
  int answered = 0;
  for (int trial = 0; answered < 2 && trial < 1000; ++trial) {
    more.clear();
    answered = 0;
    for (int i = 0; i < 4; ++i) {
      more.push_back(std::make_unique<RawSocket>(served.server.port()));
      more.back()->send("GET /a HTTP/1.1\r\nHost: localhost\r\n" + served.cookie + "\r\n");
      if (has_status(more.back()->read_header(), 200)) ++answered;
    }
    REQUIRE(answered <= 2);
  }
  CHECK(answered == 2);
  more.clear();
  CHECK(served.server.idle_time() < std::chrono::seconds(60));
}
