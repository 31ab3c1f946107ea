#include "serve.h"

#include <lambent/core/clock.h>

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <optional>
#include <thread>

#include "sanitizers.h"

namespace lambent::tool {
namespace {

struct Answer {
  int status = 0;
  std::string head, body;
};

int connected(int port) {
  const int s = ::socket(AF_INET, SOCK_STREAM, 0);
  const timeval patience{5, 0};  // an answer that does not end is none
  ::setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_in to{};
  to.sin_family = AF_INET, to.sin_port = htons(uint16_t(port)), to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(::connect(s, reinterpret_cast<sockaddr*>(&to), sizeof to), 0);
  return s;
}
void say(int s, const std::string& text) {
  EXPECT_EQ(::send(s, text.data(), text.size(), MSG_NOSIGNAL), ssize_t(text.size()));
}

// What comes back until the other side closes, byte for byte.
Answer hear(int s) {
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
Answer ask(int port, const std::string& request) {
  const int s = connected(port);
  say(s, request);
  return hear(s);
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
    serving_ = std::thread([this] {
      serve(
          listener_, files_, [this] { return stop_.load(); }, limits_);
    });
  }
  void TearDown() override {
    stop_ = true;
    serving_.join();
  }
  WebFiles files_;
  ServeLimits limits_{.seconds = 0.5, .stalled = 1};
  Listener listener_ = std::move(*listen_on(0));
  const int port_ = listener_.port;
  std::atomic<bool> stop_{false};
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
    EXPECT_TRUE(answer.body ==
                (answer.status == 200 ? files_.at("data/large").bytes() : "The file does not reach so far.\n"))
        << range;
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

TEST_F(Serve, RequestsThatAreNoneAreRefused) {
  const std::string host = "Host: 127.0.0.1:" + std::to_string(port_) + "\r\nConnection: close\r\n";
  const std::pair<std::string, int> requests[] = {
      {"GET /one HTTP/1.1\r\n" + host + "\r\n", 200},
      {"\r\nGET /one HTTP/1.0\r\n" + host + "\r\n", 200},
      {"POST /one HTTP/1.1\r\n" + host + "\r\n", 405},
      {"POST /one HTTP/1.1\r\n" + host + "Content-Length: 4\r\n\r\nbody", 413},
      {"GET /one HTTP/1.1\r\n" + host + "Content-Length: -1\r\n\r\n", 413},
      {"GET /one HTTP/1.1\r\n" + host + "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 413},
      {"GET /one HTTP/1.1\r\nHost: evil\r\n" + host + "\r\n", 403},
      {"GET /one HTTP/2.0\r\n" + host + "\r\n", 505},
      {"GET /one\r\n\r\n", 400},
      {"nonsense\r\n\r\n", 400},
      {std::string("\0\0\0\0\r\n\r\n", 8), 400},
      {"GET /one HTTP/1.1\r\nno colon\r\n" + host + "\r\n", 400},
      {"GET /one HTTP/1.1\r\n folded: 1\r\n" + host + "\r\n", 400}};
  for (const auto& [text, status] : requests) EXPECT_EQ(ask(port_, text).status, status) << text;
}

TEST_F(Serve, HeadSaysWhatGetSendsWithoutIt) {
  std::string request = get(port_, "/data/large", "bytes=5-9");
  const Answer answer = ask(port_, request.replace(0, 3, "HEAD"));
  EXPECT_EQ(answer.status, 200);
  EXPECT_NE(answer.head.find("Content-Length: 70000\r\n"), std::string::npos) << answer.head;
  EXPECT_TRUE(answer.body.empty());
}

TEST_F(Serve, HeadersAreLimitedInSizeAndNumber) {
  const std::string first = "GET /one HTTP/1.1\r\nConnection: close\r\nHost: 127.0.0.1:" + std::to_string(port_) +
                            "\r\n";
  auto with = [&](size_t count, size_t bytes) {
    std::string text = first;
    for (size_t i = 0; i < count; ++i) text += "H" + std::to_string(i) + ": " + std::string(bytes, 'x') + "\r\n";
    return text + "\r\n";
  };
  EXPECT_EQ(ask(port_, with(limits_.headers - 2, 1)).status, 200);
  EXPECT_EQ(ask(port_, with(limits_.headers - 1, 1)).status, 431);
  EXPECT_EQ(ask(port_, with(1, limits_.head_bytes - first.size() - 8)).status, 200);
  EXPECT_EQ(ask(port_, first + "H: " + std::string(limits_.head_bytes - first.size() - 3, 'x')).status, 431);
}

TEST_F(Serve, OneConnectionCarriesManyRequests) {
  std::string request = get(port_, "/one", "");
  const size_t close = request.find("Connection: close\r\n");
  std::string kept = request;
  kept.erase(close, 19);
  const int s = connected(port_);
  say(s, kept + kept + request);
  const Answer answer = hear(s);
  size_t answers = 0;
  const std::string all = answer.head + answer.body;
  for (size_t at = 0; (at = all.find("HTTP/1.1 200", at)) != std::string::npos; ++at) ++answers;
  EXPECT_EQ(answers, 3u);
}

TEST_F(Serve, TwoHundredAtOnceAreAllAnswered) {
  std::vector<std::thread> askers;
  std::atomic<int> right{0};
  const std::string whole(files_.at("data/large").bytes());
  for (int i = 0; i < 200; ++i)
    askers.emplace_back([&] {
      const Answer answer = ask(port_, get(port_, "/data/large", ""));
      right += answer.status == 200 && answer.body == whole;
    });
  for (std::thread& t : askers) t.join();
  EXPECT_EQ(right, 200);
}

TEST_F(Serve, SlowSendersAreCutOffAndKeepNobodyWaiting) {
  const auto start = Clock::now();
  auto since = [&] { return seconds_since(start); };
  std::vector<int> slow;
  for (int i = 0; i < 100; ++i) say(slow.emplace_back(connected(port_)), "GET /one HT");
  std::vector<int> silent;
  for (int i = 0; i < 100; ++i) silent.push_back(connected(port_));
  for (int i = 0; i < 20; ++i) EXPECT_EQ(ask(port_, get(port_, "/one", "")).status, 200);
  EXPECT_LT(since(), limits_.seconds) << "others waited for the slow ones";
  // A byte now and then does not help.
  for (int i = 0; i < 4; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    for (int s : slow) (void)!::send(s, "T", 1, MSG_NOSIGNAL);
  }
  for (int s : slow) EXPECT_NE(hear(s).status, 200);
  for (int s : silent) EXPECT_EQ(hear(s).status, 0);
  EXPECT_LT(since(), 5) << "they were not cut off";
}

size_t resident_bytes() {
  size_t pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return resident * size_t(::sysconf(_SC_PAGESIZE));
}

TEST_F(Serve, MemoryStaysFlat) {
  files_["huge"] = {"application/octet-stream", std::string(size_t{32} << 20, 'x')};
  for (int i = 0; i < 20; ++i) ask(port_, get(port_, "/data/large", ""));
  const size_t before = resident_bytes();
  std::vector<int> idle;  // ask for much, and take nothing of it
  for (int i = 0; i < 100; ++i) say(idle.emplace_back(connected(port_)), get(port_, "/huge", ""));
  for (int i = 0; i < 500; ++i) ask(port_, get(port_, "/data/large", ""));
  // The sanitizers' allocator keeps so much of what was given back.
  const size_t kept = under_sanitizers() ? size_t{256} << 20 : 0;
  EXPECT_LT(resident_bytes(), before + kept + (size_t{4} << 20));
  for (int s : idle) ::close(s);
}

}  // namespace
}  // namespace lambent::tool
