#include "serve.h"

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <optional>
#include <thread>

namespace lambent::tool {
namespace {

struct Answer {
  int status = 0;
  std::string head, body;
};

// What comes back over a socket, byte for byte; no client of the server's library takes part.
Answer ask(int port, const std::string& request) {
  const int s = ::socket(AF_INET, SOCK_STREAM, 0);
  const timeval patience{5, 0};  // an answer that does not end is none
  ::setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_in to{};
  to.sin_family = AF_INET, to.sin_port = htons(uint16_t(port)), to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(::connect(s, reinterpret_cast<sockaddr*>(&to), sizeof to), 0);
  EXPECT_EQ(::send(s, request.data(), request.size(), MSG_NOSIGNAL), ssize_t(request.size()));
  std::string all;
  char buffer[4096];
  for (ssize_t n; (n = ::recv(s, buffer, sizeof buffer, 0)) > 0;) all.append(buffer, size_t(n));
  ::close(s);
  Answer answer;
  const size_t end = all.find("\r\n\r\n");
  if (all.size() > 12) answer.status = std::stoi(all.substr(9, 3));
  if (end != std::string::npos) answer.head = all.substr(0, end + 2), answer.body = all.substr(end + 4);
  return answer;
}
std::string get(int port, const std::string& path, const std::string& range) {
  return "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) + "\r\nConnection: close\r\n" +
         (range.empty() ? "" : "Range: " + range + "\r\n") + "\r\n";
}

class Serve : public testing::Test {
 protected:
  void SetUp() override {
    std::string large(70'000, '\0');
    for (size_t i = 0; i < large.size(); ++i) large[i] = char('a' + i * 7 % 26);
    files_ = {{"index.html", {"text/html", std::string("<html>")}},
              {"one", {"text/plain", std::string("x")}},
              {"empty", {"text/plain", std::string()}},
              {"data/large", {"application/octet-stream", large}}};
    answer_from(server_, files_, port_);
    port_ = server_.bind_to_any_port("127.0.0.1");
    ASSERT_GT(port_, 0);
    serving_ = std::thread([this] { server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::yield();
  }
  void TearDown() override {
    server_.stop();
    serving_.join();
  }
  WebFiles files_;
  httplib::Server server_;
  int port_ = 0;
  std::thread serving_;
};

TEST_F(Serve, EveryFormOfRangeOfEveryFileStaysInside) {
  struct Form {
    std::string text;
    long first, last;  // as RFC 9110 reads it; -1: left out
    bool is_one = true;
  };
  std::vector<Form> forms{{"", -1, -1, false},
                          {"bytes=-", -1, -1, false},
                          {"bytes=0-0,2-3", -1, -1, false},
                          {"bytes=0-99,69999-300000,-7", -1, -1, false}};
  const long edges[] = {0, 1, 5, 6, 7, 65535, 65536, 69'999, 70'000, 70'001, 1L << 31, 1L << 40};
  for (long a : edges) {
    forms.push_back({"bytes=" + std::to_string(a) + "-", a, -1});
    forms.push_back({"bytes=-" + std::to_string(a), -1, a});
    for (long b : edges)
      if (b >= a) forms.push_back({"bytes=" + std::to_string(a) + "-" + std::to_string(b), a, b});
  }
  for (const auto& [name, file] : files_) {
    const std::string whole(file.bytes());
    const long size = long(whole.size());
    for (const Form& form : forms) {
      SCOPED_TRACE(name + " " + form.text);
      if (HasFailure()) return;
      const Answer answer = ask(port_, get(port_, name == "index.html" ? "/" : "/" + name, form.text));
      if (!form.is_one) {
        EXPECT_EQ(answer.status, 200);
        EXPECT_TRUE(answer.body == whole) << answer.body.size();
        continue;
      }
      const long first = form.first < 0 ? std::max(0L, size - form.last) : form.first;
      const long last = form.first < 0 || form.last < 0 ? size - 1 : std::min(form.last, size - 1);
      if (first >= size) {
        EXPECT_EQ(answer.status, 416);
        EXPECT_NE(answer.head.find("Content-Range: bytes */" + std::to_string(size) + "\r\n"), std::string::npos);
        EXPECT_EQ(answer.body.find(whole.empty() ? "\1" : whole), std::string::npos);
        continue;
      }
      EXPECT_EQ(answer.status, 206);
      EXPECT_TRUE(answer.body == whole.substr(size_t(first), size_t(last - first + 1))) << answer.body.size();
      const std::string says = "Content-Range: bytes " + std::to_string(first) + "-" + std::to_string(last) + "/" +
                               std::to_string(size) + "\r\n";
      EXPECT_NE(answer.head.find(says), std::string::npos) << answer.head;
    }
  }
}

TEST_F(Serve, RangesThatAreNoneAreRefusedOrLeftAside) {
  for (const char* range :
       {"bytes=5-2", "bytes=a-b", "lines=1-2", "bytes", "bytes=99999999999999999999-", "bytes=1-2-3", "=", "bytes=,"}) {
    const Answer answer = ask(port_, get(port_, "/data/large", range));
    EXPECT_TRUE(answer.status == 200 || answer.status == 416) << range << answer.status;
    EXPECT_TRUE(answer.body == (answer.status == 200 ? files_.at("data/large").bytes() : "")) << range;
  }
}

TEST_F(Serve, OtherPathsAndOtherNamesGetNothing) {
  for (const char* path : {"/nowhere", "/../index.html", "/data", "/data/", "//index.html", "/%2e%2e/one", "/?"})
    for (const char* range : {"", "bytes=0-3", "bytes=1000-", "bytes=-1"}) {
      const Answer answer = ask(port_, get(port_, path, range));
      EXPECT_EQ(answer.status, std::string(path) == "/?" ? (std::string(range) == "bytes=1000-" ? 416
                                                            : *range                            ? 206
                                                                                                : 200)
                                                         : 404)
          << path << " " << range;
    }
  const Answer answer =
      ask(port_, "GET /one HTTP/1.1\r\nHost: example.org\r\nConnection: close\r\nRange: bytes=0-\r\n\r\n");
  EXPECT_EQ(answer.status, 403);
}

}  // namespace
}  // namespace lambent::tool
