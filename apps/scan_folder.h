// The folder of a dataset that is being written: OUT.partial, which becomes OUT when all is there.
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

namespace dofusion {

// One run at a time works in the folder; after a kill the next one with the same settings goes on in it. Unlike
// OutputDirectory it stays when it is not committed.
class ScanFolder {
 public:
  // Opens OUT.partial, or begins one. Throws InputError if `out` is there already and not an empty folder, if
  // OUT.partial was begun with other settings (the message names the first that differs, and both values), is in use
  // by another run, or cannot be written.
  ScanFolder(const std::filesystem::path& out, const nlohmann::ordered_json& settings);
  ~ScanFolder();
  ScanFolder(const ScanFolder&) = delete;
  ScanFolder& operator=(const ScanFolder&) = delete;

  const std::filesystem::path& path() const { return partial_; }
  bool resumed() const { return resumed_; }

  void commit();   // renames it to OUT, without the record of settings
  void discard();  // deletes it

 private:
  void check_settings(const std::string& text) const;

  std::filesystem::path out_, partial_, record_;
  int lock_ = -1;
  bool resumed_ = false;
};

}  // namespace dofusion
