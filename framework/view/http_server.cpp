// SPDX-License-Identifier: Apache-2.0
// The only file that includes Boost.Beast.
#include "framework/view/http_server.h"

#include <sys/random.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>
#include <exception>
#include <list>
#include <new>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using tcp = boost::asio::ip::tcp;
using Clock = std::chrono::steady_clock;
using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

constexpr std::uint32_t kMostHeaderBytes = 8192;
constexpr std::size_t kMostTargetBytes = 256;

/// The page may run its own scripts and show its own pictures, and that is all.
constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src "
    "'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

std::string random_hex(std::size_t bytes) {
  std::string text;
  std::vector<unsigned char> drawn(bytes);
  if (getrandom(drawn.data(), bytes, 0) != ssize_t(bytes)) {
    throw Error(ErrorKind::Internal, "the system gives no random numbers");
  }
  for (const unsigned char byte : drawn) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

std::string_view plain(beast::string_view text) { return {text.data(), text.size()}; }

/// Takes the same time wherever the texts differ.
bool is_same_secret(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned differing = 0;
  for (std::size_t i = 0; i < a.size(); ++i) differing |= unsigned(a[i] ^ b[i]) & 0xffU;
  return differing == 0;
}

/// This machine by a name that no name server can give away; any port, for forwarded ones.
bool is_this_machine(std::string_view host) {
  for (const std::string_view name : {"127.0.0.1", "localhost", "[::1]"}) {
    if (!host.starts_with(name)) continue;
    const std::string_view rest = host.substr(name.size());
    if (rest.empty()) return true;
    if (rest[0] != ':' || rest.size() < 2 || rest.size() > 6) return false;
    return rest.find_first_not_of("0123456789", 1) == rest.npos;
  }
  return false;
}

bool is_plain_path(std::string_view path) {
  return path.starts_with('/') &&
         path.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/._-") == path.npos;
}

/// The value of a cookie; nothing when it is not there.
std::optional<std::string_view> cookie_of(std::string_view cookies, std::string_view name) {
  while (!cookies.empty()) {
    const std::size_t cut = cookies.find(';');
    std::string_view one = cookies.substr(0, cut);
    cookies = cut == cookies.npos ? std::string_view() : cookies.substr(cut + 1);
    one.remove_prefix(std::min(one.find_first_not_of(' '), one.size()));
    if (one.starts_with(name) && one.substr(name.size()).starts_with('=')) {
      return one.substr(name.size() + 1);
    }
  }
  return std::nullopt;
}

HttpAnswer text_answer(int status, std::string text) {
  HttpAnswer answer;
  answer.status = status;
  answer.body = std::make_shared<const std::string>(std::move(text) + "\n");
  return answer;
}

}  // namespace

struct HttpServer::State {
  Options options;
  Handler handler;
  std::string token = random_hex(16);
  /// Cookies do not tell ports apart.
  std::string cookie = "diorama_view_" + random_hex(4);
  std::atomic<Clock::rep> last_use{Clock::now().time_since_epoch().count()};
  std::atomic<std::size_t> connections{0};
  asio::io_context context;
  std::list<tcp::acceptor> acceptors;
  int port = 0;
  std::vector<std::thread> threads;

  State(const Options& given, Handler handles) : options(given), handler(std::move(handles)) {}

  void listen();
  bool listen_on(const asio::ip::address& address, int at, beast::error_code& failed);
  void accept(tcp::acceptor& acceptor);
  Response respond(const Request& request);
  std::optional<HttpAnswer> refusal(const Request& request) const;
  HttpAnswer answer(std::string_view path) const;
  void run();
};

namespace {

/// Counts itself while it lives.
class ConnectionCount {
 public:
  explicit ConnectionCount(std::atomic<std::size_t>& count) : count_(count) { ++count_; }
  ~ConnectionCount() { --count_; }
  ConnectionCount(const ConnectionCount&) = delete;
  ConnectionCount& operator=(const ConnectionCount&) = delete;

 private:
  std::atomic<std::size_t>& count_;
};

/// One connection: requests one after the other. Pending operations hold it.
template <class State>
class Connection : public std::enable_shared_from_this<Connection<State>> {
 public:
  Connection(tcp::socket socket, State& state)
      : counted_(state.connections), stream_(std::move(socket)), state_(state) {}

  void read(std::chrono::seconds time) {
    parser_.emplace();
    parser_->header_limit(kMostHeaderBytes);
    parser_->body_limit(0);
    stream_.expires_after(time);
    http::async_read(stream_, buffer_, *parser_,
                     [self = this->shared_from_this()](beast::error_code failed, std::size_t) {
                       self->take(failed);
                     });
  }

 private:
  void take(beast::error_code failed) {
    if (!failed) {
      response_ = state_.respond(parser_->get());
      return write();
    }
    // What is no request gets a word; who has left or is silent does not.
    if (failed.category() != http::make_error_code(http::error::bad_method).category() ||
        failed == http::error::end_of_stream || failed == http::error::partial_message) {
      return close();
    }
    const bool is_long = failed == http::error::header_limit;
    const bool has_body =
        failed == http::error::body_limit || failed == http::error::unexpected_body;
    response_ = {};
    response_.version(11);
    response_.result(is_long ? 431U : has_body ? 413U : 400U);
    response_.keep_alive(false);
    response_.prepare_payload();
    write();
  }

  void write() {
    stream_.expires_after(state_.options.keep_alive_time);
    http::async_write(stream_, response_,
                      [self = this->shared_from_this()](beast::error_code failed, std::size_t) {
                        if (failed || self->response_.need_eof()) return self->close();
                        self->read(self->state_.options.keep_alive_time);
                      });
  }

  void close() {
    beast::error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
    stream_.close();
  }

  ConnectionCount counted_;
  beast::tcp_stream stream_;
  State& state_;
  beast::flat_buffer buffer_{2 * kMostHeaderBytes};
  std::optional<http::request_parser<http::empty_body>> parser_;
  Response response_;
};

}  // namespace

bool HttpServer::State::listen_on(const asio::ip::address& address, int at,
                                  beast::error_code& failed) {
  tcp::acceptor acceptor(context);
  const tcp::endpoint end(address, static_cast<unsigned short>(at));
  acceptor.open(end.protocol(), failed);
  if (failed) return false;
  if (address.is_v6()) acceptor.set_option(asio::ip::v6_only(true), failed);
  acceptor.set_option(tcp::acceptor::reuse_address(true), failed);
  acceptor.bind(end, failed);
  if (failed) return false;
  acceptor.listen(asio::socket_base::max_listen_connections, failed);
  if (failed) return false;
  port = acceptor.local_endpoint().port();
  acceptors.push_back(std::move(acceptor));
  return true;
}

void HttpServer::State::listen() {
  beast::error_code failed;
  if (!listen_on(asio::ip::address_v4::loopback(), options.port, failed)) {
    throw Error(ErrorKind::Usage, "port " + std::to_string(options.port) +
                                      ": cannot be listened on (" + failed.message() +
                                      "); --port 0 takes one that is free");
  }
  // Browsers may take either for localhost. Machines without IPv6 do without.
  listen_on(asio::ip::address_v6::loopback(), port, failed);
  for (tcp::acceptor& acceptor : acceptors) accept(acceptor);
}

void HttpServer::State::accept(tcp::acceptor& acceptor) {
  acceptor.async_accept(asio::make_strand(context), [this, &acceptor](beast::error_code failed,
                                                                      tcp::socket socket) {
    if (failed == asio::error::operation_aborted) return;
    if (failed) {
      // Out of descriptors, say: not at once again.
      auto pause = std::make_shared<asio::steady_timer>(context, std::chrono::milliseconds(100));
      pause->async_wait([this, &acceptor, pause](beast::error_code stopped) {
        if (!stopped) accept(acceptor);
      });
      return;
    }
    // A surplus connection ends with its socket.
    if (connections < options.connections) {
      const auto connection = std::make_shared<Connection<State>>(std::move(socket), *this);
      connection->read(options.request_time);
    }
    accept(acceptor);
  });
}

std::optional<HttpAnswer> HttpServer::State::refusal(const Request& request) const {
  if (request.count(http::field::host) != 1 ||
      !is_this_machine(plain(request[http::field::host]))) {
    return text_answer(403, "Host: expected this machine (localhost, 127.0.0.1 or [::1])");
  }
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    return text_answer(405, "only GET and HEAD are answered");
  }
  const auto own = "http://" + std::string(plain(request[http::field::host]));
  if (request.count(http::field::origin) > 1 ||
      (request.count(http::field::origin) == 1 && plain(request[http::field::origin]) != own)) {
    return text_answer(403, "Origin: other pages get nothing");
  }
  return std::nullopt;
}

HttpAnswer HttpServer::State::answer(std::string_view path) const {
  try {
    HttpAnswer made = handler(path);
    if (!made.body) made.body = std::make_shared<const std::string>();
    return made;
  } catch (const std::exception& error) {
    return text_answer(500, error.what());
  }
}

Response HttpServer::State::respond(const Request& request) {
  const std::string_view target = plain(request.target());
  const std::string_view path = target.substr(0, target.find('?'));
  const std::string_view query = target.substr(path.size());
  constexpr std::string_view kToken = "?token=";
  const auto site = plain(request["Sec-Fetch-Site"]);
  const bool is_own_site = request.count("Sec-Fetch-Site") <= 1 &&
                           (site.empty() || site == "same-origin" || site == "none");

  std::optional<HttpAnswer> made = refusal(request);
  // The page itself, with the cookie that what it asks for takes along. A redirection would not do:
  // browsers that come from elsewhere, a file or another program's link, send no strict cookie
  // after it.
  bool greets = false;
  if (made) {
  } else if (target.size() > kMostTargetBytes) {
    made = text_answer(414, "no address here is that long");
  } else if (!is_plain_path(path)) {
    made = text_answer(400, "no address of this page");
  } else if (path == "/" && query.starts_with(kToken)) {
    greets = is_same_secret(query.substr(kToken.size()), token);
  }
  if (greets) {
    last_use = Clock::now().time_since_epoch().count();
    made = answer(path);
  } else if (!made) {
    const auto shown = request.count(http::field::cookie) == 1
                           ? cookie_of(plain(request[http::field::cookie]), cookie)
                           : std::nullopt;
    if (!shown || !is_same_secret(*shown, token)) {
      made = text_answer(403, "open the address that 'diorama view' has printed, token included");
    } else if (!is_own_site) {
      made = text_answer(403, "Sec-Fetch-Site: other sites get nothing");
    } else if (!query.empty()) {
      made = text_answer(400, "no address of this page");
    } else {
      last_use = Clock::now().time_since_epoch().count();
      made = answer(path);
    }
  }

  Response response;
  response.version(11);
  response.result(unsigned(made->status));
  response.keep_alive(request.keep_alive());
  response.set(http::field::content_type, made->type);
  response.set("Content-Security-Policy", kContentSecurityPolicy);
  response.set("X-Content-Type-Options", "nosniff");
  response.set("X-Frame-Options", "DENY");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.set("Cross-Origin-Opener-Policy", "same-origin");
  response.set(http::field::cache_control, "no-store");
  if (made->status == 405) response.set(http::field::allow, "GET, HEAD");
  if (greets) {
    response.set(http::field::set_cookie,
                 cookie + "=" + token + "; Path=/; HttpOnly; SameSite=Strict");
  }
  response.content_length(made->body->size());
  if (request.method() != http::verb::head) response.body() = *made->body;
  return response;
}

void HttpServer::State::run() {
  while (!context.stopped()) {
    try {
      context.run();
    } catch (const std::bad_alloc&) {
      // One connection is lost.
    }
  }
}

HttpServer::HttpServer(const Options& options, Handler handler)
    : state_(std::make_unique<State>(options, std::move(handler))) {
  state_->listen();
  for (int i = 0; i < std::max(options.threads, 1); ++i) {
    state_->threads.emplace_back([this] { state_->run(); });
  }
}

HttpServer::~HttpServer() {
  state_->context.stop();
  for (std::thread& thread : state_->threads) thread.join();
}

int HttpServer::port() const { return state_->port; }

std::string HttpServer::address() const {
  return "http://127.0.0.1:" + std::to_string(state_->port) + "/?token=" + state_->token;
}

std::chrono::seconds HttpServer::idle_time() const {
  const Clock::duration since(Clock::now().time_since_epoch().count() - state_->last_use.load());
  return std::chrono::duration_cast<std::chrono::seconds>(since);
}

}  // namespace diorama
