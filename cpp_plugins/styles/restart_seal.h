// What a restart file of this package ends with, after all that LAMMPS wrote: notes, one a line,
// and a seal, which tells a whole file from a damaged one. LAMMPS reads the file as its own.

#ifndef BLAST_STYLES_RESTART_SEAL_H
#define BLAST_STYLES_RESTART_SEAL_H

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace LAMMPS_NS {

// Which numbers the styles of this plugin store in restart files, and in which order: LAMMPS does
// not tell them how many there are. To be raised with every change of those.
constexpr int RESTART_LAYOUT = 1;

// Lines of a keyword and its values.
class RestartNotes {
public:
  void add(const std::string &keyword, const std::string &values);
  // Of the first line of this keyword; empty if there is none.
  std::string values(const std::string &keyword) const;
  // Of all lines of this keyword.
  std::vector<std::string> all(const std::string &keyword) const;
  std::int64_t step() const;

  std::string text() const;
  static RestartNotes of_text(const std::string &text);

private:
  std::vector<std::pair<std::string, std::string>> lines;
};

// The checksum of zip, PNG and Ethernet, of a stretch of bytes that follows others.
std::uint32_t crc32(const char *bytes, std::size_t count, std::uint32_t of_those_before = 0);

// Adds notes and seal to a restart file that LAMMPS has just written, and sees it to the disk.
// Throws std::runtime_error if LAMMPS could not write all of it, or the seal cannot be written.
void seal_restart_file(const std::string &path, const RestartNotes &notes);

// The notes of a restart file. Throws std::runtime_error, whose text goes on where the name of the
// file ends, if there is no such file or it has no seal.
RestartNotes notes_of_restart_file(const std::string &path);

// The same, for a file that is still what was sealed: every byte of it is looked at.
RestartNotes notes_of_whole_restart_file(const std::string &path);

// Waits until a file, or the names in a folder, are on the disk. Throws std::runtime_error.
void see_to_disk(const std::string &path);

} // namespace LAMMPS_NS

#endif
