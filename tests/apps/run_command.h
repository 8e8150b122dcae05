// Runs one of the toolkit's programs as a user does: its exit status and what it prints.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <sys/types.h>

namespace dofusion {

class TemporaryDirectory;

struct CommandResult {
  int status = 0;  // exit status; minus the signal's number if one ended the program
  std::string out, err;
  double peak_mb = 0.0;  // largest resident memory
};

struct CommandOptions {
  std::int64_t most_file_bytes = 0;  // files cannot grow beyond this, as on a full disk; 0: no limit
};

// A program that runs while the test goes on. It must be waited for.
class RunningCommand {
 public:
  // `words`: the program, by its path or its name in the build's bin folder, and its arguments. A runaway program is
  // ended after ten minutes of processor time.
  explicit RunningCommand(std::vector<std::string> words, const CommandOptions& options = {});
  ~RunningCommand();

  // SIGINT waits until the program catches it, at most 30 s: on a busy machine one may take long to begin.
  void send(int signal_number) const;
  bool ended();  // without waiting
  CommandResult wait();

 private:
  void reap(int options);

  std::unique_ptr<TemporaryDirectory> directory_;  // of what it prints
  pid_t child_ = -1;                               // -1: ended
  CommandResult result_;
};

// Runs `program` of the build's bin folder to its end.
CommandResult run_command(const std::string& program, const std::vector<std::string>& arguments,
                          const CommandOptions& options = {});

// The same command on two ranks: what to give RunningCommand. Empty if the build is without MPI or mpirun is missing.
std::vector<std::string> on_two_ranks(std::vector<std::string> command);

// Bad input: exit status 2, nothing on stdout and one line on stderr that holds every one of `words`.
void expect_refusal(const CommandResult& result, const std::vector<std::string>& words);

// Exit status 0; else a failure that shows what the program said.
void expect_success(const CommandResult& result);

// The names in a folder, sorted.
std::vector<std::string> entries(const std::string& folder);

}  // namespace dofusion
