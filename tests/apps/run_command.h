// Runs one of the toolkit's programs as a user does: its exit status and what it prints.
#pragma once

#include <string>
#include <vector>

#include <gmock/gmock.h>

namespace dofusion {

struct CommandResult {
  int status = 0;       // exit status; minus the signal's number if one ended the program
  std::string out, err;
  double peak_mb = 0.0;  // largest resident memory
};

// Runs `program` of the build's bin folder. A runaway program is ended after ten minutes of processor time.
CommandResult run_command(const std::string& program, const std::vector<std::string>& arguments);

// Bad input: exit status 2, nothing on stdout and one line on stderr that holds every one of `words`.
void expect_refusal(const CommandResult& result, const std::vector<std::string>& words);

// Exit status 0; else a failure that shows what the program said.
void expect_success(const CommandResult& result);

// The names in a folder, sorted.
std::vector<std::string> entries(const std::string& folder);

}  // namespace dofusion
