// What a job of scene generation has done so far: a file beside its output to which every scene is appended the moment
// it is made, so that a kill loses only the scenes in hand.
//
//   header   "dofusion-journal-2" and a zero byte, the settings' length (uint64) and text, their CRC-32
//   entry    mark, payload's length (uint32 each), payload, the payload's CRC-32
//
// All in the machine's own byte order: a journal lives as long as its job. It has an entry a scene, in the order in
// which threads and machines finished them, with poses as exact matrices.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "stability/dataset.h"

namespace dofusion {

struct JournalEntry {
  SceneRecord scene;                                   // its split is not kept
  std::int64_t drops = 0, accepted = 0, restarts = 0;  // what it took: simulations, those kept, scenes begun anew
};

// An entry's payload, and back. Decoding throws InputError on bytes that encode_entry did not make.
std::string encode_entry(const JournalEntry& entry);
JournalEntry decode_entry(const std::string& payload);

class SceneJournal {
 public:
  // Opens the journal at `path`, or begins one. What a kill left half-written at its end is cut off; an entry that is
  // damaged elsewhere counts as never made. Throws InputError if the file belongs to other settings, is no journal, is
  // in use by another run, or cannot be written.
  SceneJournal(const std::string& path, const std::string& settings);
  ~SceneJournal();
  SceneJournal(const SceneJournal&) = delete;
  SceneJournal& operator=(const SceneJournal&) = delete;

  // Every whole entry, in the order of the file.
  void for_each(const std::function<void(const JournalEntry&)>& visit) const;

  // Adds a payload of encode_entry. Throws InputError if it cannot be written; the journal stays good.
  void append(const std::string& payload);

  // Deletes the file, once its scenes are elsewhere.
  void remove();

 private:
  void begin_or_check(const std::string& settings);
  void cut_torn_end();

  std::string path_;
  int file_ = -1;
  std::size_t header_size_ = 0;
};

}  // namespace dofusion
