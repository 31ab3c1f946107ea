#include "together.h"

#include <lambent/core/clock.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#if LAMBENT_MPI
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#endif

namespace lambent::tool {

Launched launched() {
  if (std::getenv("LAMBENT_ALONE")) return {};
  // Open MPI; MPICH, Intel MPI and Slurm's PMI-2; Slurm with PMIx, which gives no size.
  for (const auto& [count, rank] :
       {std::pair("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"), std::pair("PMI_SIZE", "PMI_RANK"),
        std::pair("SLURM_STEP_NUM_TASKS", "PMIX_RANK")}) {
    const char *n = std::getenv(count), *r = std::getenv(rank);
    if (n && r) return {std::max(1, std::atoi(n)), std::max(0, std::atoi(r))};
  }
  return {};
}

#if LAMBENT_MPI

bool has_ranks() { return true; }

namespace {

constexpr size_t most_at_once = size_t{1} << 28;  // MPI counts in int
constexpr int patient = 2000;                     // looks before it sleeps between them
constexpr double seconds_for_others = 5;

volatile std::sig_atomic_t watched = 0;
extern "C" void pass_on(int signal) {
  if (watched > 0) ::kill(pid_t(watched), signal);
}

// The process goes on as a child of its own, and waits for it: where that dies of a signal (memory that the system has
// not got, as a rule), a line says so, and the job ends with the exit code of a failure.
void go_on_watched(int rank) {
  const pid_t self = ::getpid(), child = ::fork();
  if (child < 0) return;
  if (child == 0) {
    ::setpgid(0, 0);  // what is sent to the group comes once
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != self) ::_exit(1);
    return;
  }
  watched = child;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2}) ::signal(signal, pass_on);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!WIFSIGNALED(status)) ::_exit(WEXITSTATUS(status));
  const std::string said = "lambent: rank " + std::to_string(rank) + " died: " + ::strsignal(WTERMSIG(status)) +
                           "; the job ends\n";
  (void)!::write(2, said.data(), said.size());
  ::_exit(1);
}

class MpiRanks final : public Together {
 public:
  MpiRanks() {
    int provided = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
    MPI_Comm_dup(MPI_COMM_WORLD, &work_);
    MPI_Comm_dup(MPI_COMM_WORLD, &last_);
    MPI_Comm_rank(work_, &rank_);
    MPI_Comm_size(work_, &count_);
    MPI_Comm here;
    MPI_Comm_split_type(work_, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &here);
    MPI_Comm_size(here, &local_);
    MPI_Comm_free(&here);
  }
  int rank() const override { return rank_; }
  int count() const override { return count_; }
  int local_count() const override { return local_; }

  bool all(bool mine) override {
    int in = mine, out = 0;
    std::vector<MPI_Request> request(1);
    MPI_Iallreduce(&in, &out, 1, MPI_INT, MPI_LAND, work_, request.data());
    wait(request);
    return out;
  }

  void broadcast(std::span<uint8_t> bytes) override {
    std::vector<MPI_Request> requests;
    for (size_t at = 0; at < bytes.size(); at += most_at_once)
      MPI_Ibcast(bytes.data() + at, length(bytes.size(), at), MPI_BYTE, 0, work_, &requests.emplace_back());
    wait(requests);
    received += rank_ > 0 ? bytes.size() : 0;
  }

  void exchange(std::span<const std::span<const uint8_t>> give, std::span<const std::span<uint8_t>> take) override {
    std::vector<MPI_Request> requests;
    for (int i = 1; i < count_; ++i) {
      const int from = (rank_ + count_ - i) % count_;
      const std::span<uint8_t> bytes = take[size_t(from)];
      for (size_t at = 0; at < bytes.size(); at += most_at_once)
        MPI_Irecv(bytes.data() + at, length(bytes.size(), at), MPI_BYTE, from, 0, work_, &requests.emplace_back());
      received += bytes.size();
    }
    for (int i = 1; i < count_; ++i) {
      const int to = (rank_ + i) % count_;
      const std::span<const uint8_t> bytes = give[size_t(to)];
      for (size_t at = 0; at < bytes.size(); at += most_at_once)
        MPI_Isend(bytes.data() + at, length(bytes.size(), at), MPI_BYTE, to, 0, work_, &requests.emplace_back());
    }
    wait(requests);
  }

  void say(const std::string& line) override {
    const std::string text = "warning: rank " + std::to_string(rank_) + ": " + line + "\n";
    std::fwrite(text.data(), 1, text.size(), stderr);
  }

  int end(int code, const std::function<void()>& failed_alone) override {
    int worst = code, done = 0;
    MPI_Request request;
    MPI_Iallreduce(&code, &worst, 1, MPI_INT, MPI_MAX, last_, &request);
    const auto start = Clock::now();
    while (MPI_Test(&request, &done, MPI_STATUS_IGNORE), !done) {
      ::usleep(1000);
      if (code == 0 || seconds_since(start) < seconds_for_others) continue;
      failed_alone();
      MPI_Abort(MPI_COMM_WORLD, code);
    }
    MPI_Comm_free(&work_), MPI_Comm_free(&last_);
    MPI_Finalize();
    return worst;
  }

 private:
  static int length(size_t bytes, size_t at) { return int(std::min(most_at_once, bytes - at)); }

  // MPI itself waits by looking all the time, which takes a core that another rank may want.
  static void wait(std::vector<MPI_Request>& requests) {
    int done = 0;
    for (int looks = 0; MPI_Testall(int(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE), !done; ++looks)
      if (looks < patient) ::sched_yield();
      else ::usleep(100);
  }

  MPI_Comm work_, last_;
  int rank_ = 0, count_ = 1, local_ = 1;
};

}  // namespace

std::unique_ptr<Together> Together::begin() {
  go_on_watched(launched().rank);
  return std::make_unique<MpiRanks>();
}

#else

bool has_ranks() { return false; }
std::unique_ptr<Together> Together::begin() { return nullptr; }

#endif

}  // namespace lambent::tool
