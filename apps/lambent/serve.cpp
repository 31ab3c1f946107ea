#include "serve.h"

#include <lambent/core/clock.h>

#include <fmt/format.h>

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <list>
#include <optional>

namespace lambent::tool {
namespace {

constexpr size_t piece = size_t{1} << 18;  // of an answer, before others have their turn

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
  return out;
}
std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

struct Request {
  std::string method, target;
  std::multimap<std::string, std::string> headers;  // names in lower case
  bool keeps_alive = true;
  std::string_view header(const char* name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? std::string_view() : std::string_view(found->second);
  }
};

// The head without the empty line at its end. An error is a status.
std::variant<Request, int> parse_head(std::string_view head, const ServeLimits& limits) {
  const auto take_line = [&head] {
    const size_t end = head.find("\r\n");
    const std::string_view line = head.substr(0, end);
    head.remove_prefix(end == std::string_view::npos ? head.size() : end + 2);
    return line;
  };
  const std::string_view line = take_line();
  const size_t first = line.find(' '), last = line.rfind(' ');
  if (first == std::string_view::npos || first == last || first == 0) return 400;
  Request request;
  request.method = line.substr(0, first), request.target = line.substr(first + 1, last - first - 1);
  const std::string_view version = line.substr(last + 1);
  if (!version.starts_with("HTTP/")) return 400;
  if (version != "HTTP/1.1" && version != "HTTP/1.0") return 505;
  while (!head.empty()) {
    const std::string_view header = take_line();
    const size_t colon = header.find(':');
    if (colon == std::string_view::npos || colon == 0 || header.find_first_of(" \t") < colon) return 400;
    if (request.headers.size() == limits.headers) return 431;
    request.headers.emplace(lower(header.substr(0, colon)), trimmed(header.substr(colon + 1)));
  }
  const std::string connection = lower(request.header("connection"));
  request.keeps_alive = version == "HTTP/1.1" ? connection != "close" : connection == "keep-alive";
  return request;
}

struct ByteRange {
  size_t first, count;
};
enum class RangeKind { none, one, beyond };

// Digits that say more than there are bytes say as many as there can be.
std::optional<size_t> number(std::string_view digits) {
  if (digits.empty()) return std::nullopt;
  size_t value = 0;
  for (char c : digits) {
    if (c < '0' || c > '9') return std::nullopt;
    value = value > SIZE_MAX / 10 - 1 ? SIZE_MAX : value * 10 + size_t(c - '0');
  }
  return value;
}

// What is malformed, and several ranges at once, count as none.
RangeKind parse_range(std::string_view text, size_t size, ByteRange& out) {
  const size_t equals = text.find('=');
  if (equals == std::string_view::npos || lower(trimmed(text.substr(0, equals))) != "bytes") return RangeKind::none;
  text = trimmed(text.substr(equals + 1));
  const size_t dash = text.find('-');
  if (dash == std::string_view::npos) return RangeKind::none;
  const std::string_view before = text.substr(0, dash), after = text.substr(dash + 1);
  const auto first = number(before), last = number(after);
  if ((!first && !before.empty()) || (!last && !after.empty()) || (!first && !last)) return RangeKind::none;
  if (first && last && *last < *first) return RangeKind::none;
  const size_t begin = first ? *first : size - std::min(*last, size);  // the last so many bytes
  if (begin >= size) return RangeKind::beyond;
  out = {begin, (first && last ? std::min(*last, size - 1) : size - 1) - begin + 1};
  return RangeKind::one;
}

struct Answer {
  std::string head;
  std::string_view body;  // of a file, or constant
  bool closes = false;
};

const char* reason(int status) {
  switch (status) {
    case 200: return "OK";
    case 206: return "Partial Content";
    case 400: return "Bad Request";
    case 403: return "Forbidden";
    case 404: return "Not Found";
    case 405: return "Method Not Allowed";
    case 408: return "Request Timeout";
    case 413: return "Content Too Large";
    case 416: return "Range Not Satisfiable";
    case 431: return "Request Header Fields Too Large";
    default: return "HTTP Version Not Supported";
  }
}

Answer make_answer(int status, const std::string& type, std::string_view body, const std::string& more, bool keeps) {
  char date[64];
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::strftime(date, sizeof date, "%a, %d %b %Y %H:%M:%S GMT", &parts);
  return {fmt::format("HTTP/1.1 {} {}\r\nDate: {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: {}\r\n"
                      "X-Content-Type-Options: nosniff\r\nCache-Control: no-store\r\n"
                      "Cross-Origin-Resource-Policy: same-origin\r\n{}\r\n",
                      status, reason(status), date, type, body.size(), keeps ? "keep-alive" : "close", more),
          body, !keeps};
}

// Errors of the form of a request end the connection: where the next one would begin is not known.
Answer refuse(int status, const char* message, bool keeps = false, const std::string& more = {}) {
  return make_answer(status, "text/plain", message, more, keeps);
}

Answer answer_to(const Request& request, const WebFiles& files, int port) {
  const bool keeps = request.keeps_alive;
  if (!request.header("transfer-encoding").empty() || request.headers.count("content-length") > 1 ||
      number(request.headers.contains("content-length") ? request.header("content-length") : "0") != size_t{0})
    return refuse(413, "Requests have no content here.\n");
  const std::string tail = ":" + std::to_string(port);
  const std::string_view host = request.header("host");
  if (request.headers.count("host") != 1 || (host != "127.0.0.1" + tail && host != "localhost" + tail))
    return refuse(403, "This server answers its own machine only.\n", keeps);
  if (request.method != "GET" && request.method != "HEAD")
    return refuse(405, "Files are got here, and nothing else.\n", keeps, "Allow: GET, HEAD\r\n");
  const std::string path = request.target.substr(0, request.target.find_first_of("?#"));
  const auto file = files.find(path == "/" ? "index.html" : path.starts_with('/') ? path.substr(1) : "");
  if (file == files.end()) return refuse(404, "There is no such file.\n", keeps);
  const std::string_view bytes = file->second.bytes();
  ByteRange range{0, bytes.size()};
  const bool wants_range = request.method == "GET" && request.headers.count("range") == 1 &&
                           !request.headers.contains("if-range");  // which no file here can match
  const RangeKind kind = wants_range ? parse_range(request.header("range"), bytes.size(), range) : RangeKind::none;
  if (kind == RangeKind::beyond)
    return refuse(416, "The file does not reach so far.\n", keeps,
                  fmt::format("Content-Range: bytes */{}\r\n", bytes.size()));
  std::string more = "Accept-Ranges: bytes\r\n";
  if (kind == RangeKind::one)
    more += fmt::format("Content-Range: bytes {}-{}/{}\r\n", range.first, range.first + range.count - 1, bytes.size());
  return make_answer(kind == RangeKind::one ? 206 : 200, file->second.type, bytes.substr(range.first, range.count),
                     more, keeps);
}

// One connection: a request is read whole, then answered, then the next.
struct Connection {
  int socket;
  Clock::time_point since = Clock::now();  // of the last answer's end; while one is sent, of its last progress
  std::string in{};
  Answer out{};
  size_t sent = 0;                                   // of head and body
  bool sends = false, ends = false, closed = false;  // ends: all is sent, and what still comes is left aside

  // What of the answer is next; empty: all is sent.
  std::string_view rest() const {
    return sent < out.head.size() ? std::string_view(out.head).substr(sent) : out.body.substr(sent - out.head.size());
  }
};

struct Serving {
  const Listener& listener;
  const WebFiles& files;
  const ServeLimits& limits;
  std::list<Connection> connections{};

  void begin_answer(Connection& c, Answer answer) {
    c.out = std::move(answer), c.sent = 0, c.sends = true, c.since = Clock::now();
  }

  // Answers what has come whole.
  void take_request(Connection& c) {
    while (c.in.starts_with("\r\n")) c.in.erase(0, 2);
    const size_t end = c.in.find("\r\n\r\n");
    if (end == std::string::npos ? c.in.size() >= limits.head_bytes : end + 4 > limits.head_bytes)
      return begin_answer(c, refuse(431, "The request's head is too long.\n"));
    if (end == std::string::npos) return;
    const auto parsed = parse_head(std::string_view(c.in).substr(0, end), limits);
    c.in.erase(0, end + 4);
    const auto* request = std::get_if<Request>(&parsed);
    if (!request) return begin_answer(c, refuse(std::get<int>(parsed), "That is no request that is known here.\n"));
    Answer answer = answer_to(*request, files, listener.port);
    if (request->method == "HEAD") answer.body = {};
    begin_answer(c, std::move(answer));
  }

  void receive(Connection& c) {
    char buffer[4096];
    const ssize_t got = ::recv(c.socket, buffer, sizeof buffer, 0);
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) c.closed = true;
    if (got <= 0 || c.ends) return;
    c.in.append(buffer, size_t(got));
    take_request(c);
  }

  void send(Connection& c) {
    size_t budget = piece;
    for (std::string_view rest; budget > 0 && !(rest = c.rest()).empty();) {
      const ssize_t put = ::send(c.socket, rest.data(), std::min(rest.size(), budget), MSG_NOSIGNAL);
      if (put < 0 && (errno == EAGAIN || errno == EINTR)) return;
      if (put <= 0) return void(c.closed = true);
      c.sent += size_t(put), budget -= size_t(put), c.since = Clock::now();
    }
    if (!c.rest().empty()) return;
    c.sends = false;
    c.ends = c.out.closes, c.out = {};
    if (c.ends) ::shutdown(c.socket, SHUT_WR), c.in.clear();  // closed at once, what was not read would undo the answer
    else if (!c.in.empty()) take_request(c);
  }

  void accept_all() {
    for (int fd; (fd = ::accept4(listener.socket, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0;) {
      const int buffer = int(piece);  // what the system keeps of answers that nobody takes
      ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
      connections.push_back({fd});
      if (connections.size() > limits.connections) close_idlest();
    }
    if (errno == EMFILE || errno == ENFILE) close_idlest();
  }
  void close_idlest() {
    const auto idlest = std::min_element(connections.begin(), connections.end(),
                                         [](const Connection& a, const Connection& b) { return a.since < b.since; });
    if (idlest == connections.end()) return;
    ::close(idlest->socket);
    connections.erase(idlest);
  }

  // Those that are late, or done.
  void drop() {
    const auto now = Clock::now();
    for (auto c = connections.begin(); c != connections.end();) {
      const double waited = std::chrono::duration<double>(now - c->since).count();
      if (!c->sends && !c->closed && waited > limits.seconds) {
        if (c->in.empty()) c->closed = true;  // it had nothing to ask, or is answered
        else begin_answer(*c, refuse(408, "The request did not come in time.\n"));
      }
      if (c->sends ? waited > limits.stalled : c->ends && waited > 1) c->closed = true;
      if (!c->closed) {
        ++c;
        continue;
      }
      ::close(c->socket);
      c = connections.erase(c);
    }
  }

  void turn() {
    std::vector<pollfd> waits{{listener.socket, POLLIN, 0}};
    for (const Connection& c : connections) waits.push_back({c.socket, short(c.sends ? POLLOUT : POLLIN), 0});
    if (::poll(waits.data(), waits.size(), 50) > 0) {
      size_t i = 1;
      for (Connection& c : connections) {
        const short found = waits[i++].revents;
        if (!found) continue;
        if (c.sends) send(c);
        else receive(c);
        if (c.sends && !c.closed) send(c);
      }
      if (waits[0].revents) accept_all();
    }
    drop();
  }
};

}  // namespace

Listener::~Listener() {
  if (socket >= 0) ::close(socket);
}

Result<Listener> listen_on(int port) {
  Listener listener(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), port);
  const int yes = 1;  // a port that was just left is free
  ::setsockopt(listener.socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in at{};
  at.sin_family = AF_INET, at.sin_port = htons(uint16_t(port)), at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  if (listener.socket < 0 || ::bind(listener.socket, reinterpret_cast<sockaddr*>(&at), size) != 0 ||
      ::listen(listener.socket, SOMAXCONN) != 0 ||
      ::getsockname(listener.socket, reinterpret_cast<sockaddr*>(&at), &size) != 0)
    return Error{"--port", port ? "port " + std::to_string(port) + " is taken or not allowed" : "no port is free",
                 true};
  listener.port = ntohs(at.sin_port);
  return listener;
}

void serve(const Listener& listener, const WebFiles& files, const std::function<bool()>& stop,
           const ServeLimits& limits) {
  Serving serving{listener, files, limits};
  while (!stop()) serving.turn();
  for (const Connection& c : serving.connections) ::close(c.socket);
}

}  // namespace lambent::tool
