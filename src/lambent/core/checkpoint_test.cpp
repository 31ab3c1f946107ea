#include <lambent/core/checkpoint.h>
#include <lambent/core/file.h>

#include "temporary_folder.h"

#include <gtest/gtest.h>

#include <sys/stat.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <numeric>
#include <set>
#include <thread>

namespace lambent {
namespace {

// Work of 50 pieces that knows how many it made.
struct Work {
  std::vector<std::vector<double>> values{50};
  size_t made = 0;

  void run(Progress& progress) {
    const KeptPieces pieces(&progress, "work", values.size());
    for (size_t i = 0; i < values.size(); ++i) {
      std::array<uint8_t, 3> tag{};
      uint32_t number = 0;
      if (pieces.load(i, values[i], std::span(tag), number)) {
        EXPECT_EQ(number, i);
        EXPECT_EQ(tag[2], uint8_t(i));
        continue;
      }
      ++made, number = uint32_t(i), tag[2] = uint8_t(i);
      values[i].resize(i * 7);
      std::iota(values[i].begin(), values[i].end(), double(i) / 3);
      pieces.save(i, values[i], std::span(tag), number);
    }
  }
};

class Checkpoints : public testing::Test {
 protected:
  test::TemporaryFolder folder;
  std::vector<std::string> warnings;
  std::string at(const char* name) const { return folder.file(std::string("c/") + name); }
  CheckpointOptions options(double after = 0) {
    CheckpointOptions o;
    o.folder = folder.file("c"), o.identity = "{\"work\": 1}", o.after = after;
    o.warn = [this](const std::string& line) { warnings.push_back(line); };
    return o;
  }
  Work expected = [] {
    Work w;
    Progress nowhere;
    w.run(nowhere);
    return w;
  }();
  // Runs the work with the checkpoint; how many pieces it made.
  size_t run() {
    Checkpoint checkpoint(options());
    auto ok = checkpoint.begin();
    EXPECT_TRUE(ok) << ok.error().text();
    Progress progress;
    progress.checkpoint = &checkpoint;
    Work work;
    work.run(progress);
    EXPECT_EQ(work.values, expected.values);
    EXPECT_EQ(checkpoint.taken() + work.made, work.values.size());
    return work.made;
  }
};

TEST_F(Checkpoints, WorkIsMadeOnce) {
  EXPECT_EQ(run(), 50u);
  EXPECT_EQ(run(), 0u);
  EXPECT_TRUE(warnings.empty());
  EXPECT_TRUE(remove_checkpoint(folder.file("c")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("c")));
}

// Small pieces are buffered, large ones written from where they are; from several threads, in any order.
TEST_F(Checkpoints, PiecesOfAnySizeComeBack) {
  constexpr size_t sizes[] = {0, 1, 7, 8, 4099, 65'400, 65'536, 65'541, 300'001};
  auto bytes_of = [&](size_t piece) {
    std::vector<uint8_t> bytes(sizes[piece % std::size(sizes)]);
    for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = uint8_t(i * 31 + piece);
    return bytes;
  };
  constexpr size_t count = 6 * std::size(sizes);
  for (const bool again : {false, true}) {
    Checkpoint checkpoint(options());
    ASSERT_TRUE(checkpoint.begin());
    Progress progress;
    progress.checkpoint = &checkpoint;
    const KeptPieces pieces(&progress, "sizes", count);
    std::vector<std::thread> threads;
    for (size_t t = 0; t < 3; ++t)
      threads.emplace_back([&, t] {
        for (size_t i = t; i < count; i += 3) {
          std::vector<uint8_t> first, last;
          EXPECT_EQ(pieces.load(i, first, last), again);
          if (!again) pieces.save(i, first = bytes_of(i), last = bytes_of(i + 1));
          EXPECT_TRUE(first == bytes_of(i) && last == bytes_of(i + 1)) << i;
        }
      });
    for (std::thread& thread : threads) thread.join();
  }
  EXPECT_TRUE(warnings.empty());
}

// Every byte of the file flipped in its turn: pieces that are damaged are made again, and all others are there.
TEST_F(Checkpoints, FlippedBitsCostTheirPiecesAlone) {
  run();
  const auto sound = *read_file(at("work.pieces"));
  for (size_t i = 0; i < sound.size(); i += 53) {
    auto bytes = sound;
    bytes[i] ^= uint8_t(1 << i % 8);
    folder.write("c/work.pieces", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    warnings.clear();
    ASSERT_LE(run(), 1u) << "byte " << i;
    ASSERT_EQ(run(), 0u) << "byte " << i;
    ASSERT_LE(warnings.size(), 2u);
  }
}

// Cut short anywhere, with rubbish, zeros or nothing after that.
TEST_F(Checkpoints, TornFilesKeepWhatIsWhole) {
  run();
  const auto sound = *read_file(at("work.pieces"));
  size_t last = 51;
  for (size_t size = 0; size <= sound.size(); size += 307)
    for (const std::string& tail : {std::string(), std::string(300, '\0'), std::string(77, 'x')}) {
      folder.write("c/work.pieces", std::string(reinterpret_cast<const char*>(sound.data()), size) + tail);
      const size_t made = run();
      ASSERT_LE(made, last);
      if (tail.size() == 77) last = made;
      ASSERT_EQ(run(), 0u);
    }
  EXPECT_LE(last, 2u);
}

TEST_F(Checkpoints, WhatIsNotOursIsRefusedAndLeftAlone) {
  run();
  CheckpointOptions other = options();
  other.check = [](std::span<const uint8_t> bytes) -> Result<void> {
    return Error{"c", "is of " + std::string(bytes.begin(), bytes.end())};
  };
  auto refused = Checkpoint(other).begin();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message, "is of {\"work\": 1}");
  folder.write("c/letter.txt", "dear");
  refused = Checkpoint(options()).begin();
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("letter.txt"), std::string::npos);
  EXPECT_TRUE(remove_checkpoint(folder.file("c")));
  EXPECT_TRUE(std::filesystem::exists(at("letter.txt")));
}

TEST_F(Checkpoints, OneProcessAtATimeHasIt) {
  Checkpoint first(options());
  ASSERT_TRUE(first.begin());
  EXPECT_TRUE(is_checkpoint_in_use(folder.file("c")));
  auto second = Checkpoint(options()).begin();
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().message, "is in use by another process");
  EXPECT_FALSE(remove_checkpoint(folder.file("c")));
}

TEST_F(Checkpoints, ShortWorkLeavesNothing) {
  Checkpoint checkpoint(options(60));
  Progress progress;
  progress.checkpoint = &checkpoint;
  Work().run(progress);
  EXPECT_FALSE(checkpoint.began());
  EXPECT_FALSE(std::filesystem::exists(folder.file("c")));
}

TEST_F(Checkpoints, LongWorkIsKeptOnceItIsKnownToBe) {
  Checkpoint checkpoint(options(60));
  Progress progress;
  progress.checkpoint = &checkpoint;
  const KeptPieces pieces(&progress, "slow", 1000);  // a second apart: 1000 seconds
  double value = 1;
  pieces.save(0, value);
  EXPECT_FALSE(checkpoint.began());
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  pieces.save(1, value);
  EXPECT_TRUE(checkpoint.began());
  checkpoint.remove();
  EXPECT_FALSE(std::filesystem::exists(folder.file("c")));
}

TEST_F(Checkpoints, NothingUnfinishedIsKept) {
  Checkpoint checkpoint(options());
  ASSERT_TRUE(checkpoint.begin());
  Progress progress;
  progress.checkpoint = &checkpoint;
  const KeptPieces pieces(&progress, "work", 2);
  double value = 1;
  progress.cancel();
  pieces.save(0, value);
  checkpoint.flush();
  EXPECT_EQ(std::filesystem::file_size(at("work.pieces")), 0u);
}

TEST_F(Checkpoints, WhatCannotBeWrittenEndsTheKeepingAndNotTheWork) {
  std::filesystem::create_directory(folder.file("c"));
  folder.write("c/checkpoint.json", "{}");
  std::filesystem::create_symlink("/dev/full", at("work.pieces"));  // no link of others is followed
  EXPECT_EQ(run(), 50u);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("no more is kept"), std::string::npos) << warnings[0];
}

// Two files that belong together, replaced again and again by a process that is killed: both are always of one time.
TEST(FileSets, AreWholeWhenTheirWriterIsKilled) {
  const test::TemporaryFolder folder;
  const std::string a = folder.file("a.exr"), b = folder.file("a.glb");
  std::set<std::string> seen;
  // The one that renames outlives the writer; it becomes a child of this process, which can wait for it, so that no two
  // of them are ever at work at a time.
  ASSERT_EQ(::prctl(PR_SET_CHILD_SUBREAPER, 1), 0);
  for (int round = 0; round < 150 || (seen.size() <= 5 && round < 1500); ++round) {
    const pid_t child = ::fork();
    if (child == 0) {
      for (int i = 0;; ++i) {
        const std::string text = std::to_string(round) + "." + std::to_string(i);
        FileSet set;
        if (!write_file_atomically(a, text) || !write_file_atomically(b, text) || !set.commit()) ::_exit(1);
      }
    }
    ::usleep(useconds_t((500 + 997 * round % 6000) * (1 + round / 150)));  // a busy machine gets more
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the writer failed";
    while (::waitpid(-1, nullptr, 0) > 0 || errno == EINTR) {
    }
    const auto first = read_file(a), second = read_file(b);
    ASSERT_EQ(bool(first), bool(second));
    if (!first) continue;
    ASSERT_EQ(*first, *second);
    seen.emplace(first->begin(), first->end());
  }
  ASSERT_EQ(::prctl(PR_SET_CHILD_SUBREAPER, 0), 0);
  EXPECT_GT(seen.size(), 5u);
  // What the killed left is cleaned by the next, or the one after, while the last one's renamer is still there.
  size_t files = 0;
  for (int i = 0; i < 5000 && files != 2; ++i) {
    if (i > 0) ::usleep(1000);
    ASSERT_TRUE(write_file_atomically(a, "x"));
    ASSERT_TRUE(write_file_atomically(b, "x"));
    files = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path)) ++files;
  }
  EXPECT_EQ(files, 2u);
}

TEST(FileSets, AppearTogetherOrNotAtAll) {
  const test::TemporaryFolder folder;
  {
    FileSet set;
    ASSERT_TRUE(write_file_atomically(folder.file("a"), "1"));
    EXPECT_FALSE(std::filesystem::exists(folder.file("a")));
    EXPECT_FALSE(write_file_atomically(folder.file("no/b"), "1"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path));
}

TEST(Files, KeepModesAndLinksOfWhatTheyReplace) {
  const test::TemporaryFolder folder;
  folder.write("real", "old");
  ASSERT_EQ(::chmod(folder.file("real").c_str(), 0640), 0);
  std::filesystem::create_symlink("real", folder.path / "link");
  std::filesystem::create_symlink("later", folder.path / "dangling");
  ASSERT_TRUE(write_file_atomically(folder.file("link"), "new"));
  ASSERT_TRUE(write_file_atomically(folder.file("dangling"), "first"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path / "link"));
  EXPECT_EQ((*read_file(folder.file("real")))[0], 'n');
  EXPECT_EQ((*read_file(folder.file("later")))[0], 'f');
  EXPECT_EQ(int(std::filesystem::status(folder.path / "real").permissions()), 0640);
}

TEST(Files, AreWrittenOverPlainFilesAlone) {
  auto refused = write_file_atomically("/dev/null", "x");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("not a plain file"), std::string::npos);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(Files, ThatAreReadAreNotWrittenOver) {
  const test::TemporaryFolder folder;
  folder.write("in", "old");
  std::filesystem::create_hard_link(folder.path / "in", folder.path / "same");
  std::filesystem::create_symlink("in", folder.path / "link");
  const ReadLog log;
  ASSERT_TRUE(read_file(folder.file("in")));
  for (const char* name : {"in", "same", "link"}) EXPECT_FALSE(write_file_atomically(folder.file(name), "new")) << name;
  EXPECT_TRUE(write_file_atomically(folder.file("other"), "new"));
  EXPECT_EQ((*read_file(folder.file("in")))[0], 'o');
  allow_replacing(folder.file("in"));
  EXPECT_TRUE(write_file_atomically(folder.file("in"), "new"));
}

}  // namespace
}  // namespace lambent
