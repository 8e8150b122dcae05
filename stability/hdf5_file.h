// The part of HDF5 that datasets need: tables of numbers, lists of strings, attributes. Identifiers close themselves,
// and HDF5's own error output is silenced: what goes wrong is one InputError that names the file and the table.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <hdf5.h>

#include "stability/files.h"

namespace dofusion {

template <class T>
hid_t hdf5_type();
template <>
inline hid_t hdf5_type<double>() {
  return H5T_NATIVE_DOUBLE;
}
template <>
inline hid_t hdf5_type<std::int64_t>() {
  return H5T_NATIVE_INT64;
}
template <>
inline hid_t hdf5_type<std::int32_t>() {
  return H5T_NATIVE_INT32;
}
template <>
inline hid_t hdf5_type<std::uint32_t>() {
  return H5T_NATIVE_UINT32;
}
template <>
inline hid_t hdf5_type<std::uint8_t>() {
  return H5T_NATIVE_UINT8;
}

// An HDF5 identifier, closed by the function that fits it. Throws InputError(what) on one that is not valid.
class Hdf5Handle {
 public:
  Hdf5Handle(hid_t id, herr_t (*close)(hid_t), const std::string& what) : id_(id), close_(close) {
    if (id_ < 0) throw InputError(what);
  }
  ~Hdf5Handle() { close_(id_); }
  Hdf5Handle(const Hdf5Handle&) = delete;
  Hdf5Handle& operator=(const Hdf5Handle&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

class Hdf5Reader {
 public:
  // Throws InputError that says whether there is no such file, it may not be read, is being written by another
  // process, is damaged, or no HDF5 at all.
  explicit Hdf5Reader(const std::string& path);

  // A table of `columns` columns with any number of rows, row by row; one-dimensional if `columns` is 1.
  template <class T>
  std::vector<T> table(const std::string& name, std::size_t columns) const {
    std::vector<T> values(open_table(name, columns, sizeof(T)) * columns);
    read_table(name, hdf5_type<T>(), values.data());
    return values;
  }
  std::vector<std::string> strings(const std::string& name) const;
  std::string text_attribute(const std::string& name) const;
  std::int64_t integer_attribute(const std::string& name) const;

  // Throws InputError: the file and `what` is wrong with it.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  // Rows, once the shape is right and the file large enough for it.
  std::size_t open_table(const std::string& name, std::size_t columns, std::size_t value_size) const;
  void read_table(const std::string& name, hid_t type, void* values) const;
  void check_size(const std::string& name, hid_t data, hsize_t count, hsize_t value_size) const;

  std::string path_;
  Hdf5Handle file_;
};

// Makes the bytes of an HDF5 file in memory: nothing is left half-written if the disk is full. The same calls give the
// same bytes at any time of day.
class Hdf5Writer {
 public:
  Hdf5Writer();
  void group(const std::string& name);
  template <class T>
  void table(const std::string& name, const std::vector<T>& values, std::size_t columns) {
    write_table(name, hdf5_type<T>(), values.data(), values.size() / columns, columns);
  }
  void strings(const std::string& name, const std::vector<std::string>& values);
  void text_attribute(const std::string& name, const std::string& text);
  void integer_attribute(const std::string& name, std::int64_t value);

  std::string bytes();  // of the whole file

 private:
  void write_table(const std::string& name, hid_t type, const void* values, std::size_t rows, std::size_t columns);
  void write(const std::string& name, hid_t type, hid_t space, const void* values);

  Hdf5Handle file_;
};

}  // namespace dofusion
