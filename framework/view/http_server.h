// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace diorama {

struct HttpAnswer {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::shared_ptr<const std::string> body;
};

/// Answers GET requests of browsers on this machine that know the token, and nobody else. It
/// listens on the loopback addresses only; wants a Host that is this machine (against rebound
/// names), no Origin but its own, no other site behind the request, and the token: once in the
/// address, afterwards as a cookie that scripts do not see and other sites do not send. Bodies and
/// long headers are refused, slow and surplus connections closed, nothing is kept by the browser.
/// Paths reach the handler only as letters, digits and "/._-".
class HttpServer {
 public:
  struct Options {
    int port = 0;  ///< 0: one that is free.
    int threads = 4;
    std::size_t connections = 64;
    std::chrono::seconds request_time{10};     ///< For a whole header to come.
    std::chrono::seconds keep_alive_time{60};  ///< Between requests.
  };
  /// Called on several threads at once. What it throws becomes an answer 500 with the text.
  using Handler = std::function<HttpAnswer(std::string_view path)>;

  /// Listens from now on. Throws Error(Usage) when the port is taken.
  HttpServer(const Options& options, Handler handler);
  /// Ends all connections and waits for the handlers that are at work.
  ~HttpServer();

  int port() const;
  /// What to open in a browser, token included.
  std::string address() const;
  /// Since the last request that knew the token, or the start.
  std::chrono::seconds idle_time() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
