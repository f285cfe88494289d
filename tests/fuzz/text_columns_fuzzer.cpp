// A coverage-guided search for bytes that read_text_columns takes for numbers and Python's reader
// would not, or at which it leaves its buffers. For ten minutes of it:
//
//   clang++ -std=c++17 -O1 -g -fsanitize=fuzzer,address,undefined \
//     cpp_plugins/text_columns.cpp tests/fuzz/text_columns_fuzzer.cpp -o text_columns_fuzzer
//   ./text_columns_fuzzer -max_total_time=600 -max_len=256
//
// The first byte of an input is the number of columns, the rest is the text. Rows are as many as
// the text has line ends, so that the parser can agree.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

extern "C" bool read_text_columns(const char *text, std::size_t begin, std::size_t end,
                                  std::size_t rows, std::size_t columns, double *table);

namespace {

// The slow reader: words between blanks, each one a number to strtod, as many as there are columns.
std::vector<double> numbers_of_lines(const std::string &text, std::size_t columns)
{
  std::vector<double> numbers;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t before = numbers.size();
    std::istringstream words(line);
    for (std::string word; words >> word;) {
      char *stop = nullptr;
      numbers.push_back(std::strtod(word.c_str(), &stop));
      if (*stop != '\0' || word.find_first_of("xX(") != std::string::npos) std::abort();
    }
    if (numbers.size() - before != columns) std::abort();
  }
  return numbers;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  if (size < 2) return 0;
  const std::size_t columns = data[0] % 20;
  // Neither the text nor the table has a byte to spare: the sanitizer sees a step beyond.
  const std::vector<char> text(data + 1, data + size);
  std::size_t rows = 0;
  for (const char c : text) rows += c == '\n';
  std::vector<double> table(rows * columns);
  if (!read_text_columns(text.data(), 0, text.size(), rows, columns, table.data())) return 0;

  const std::vector<double> expected = numbers_of_lines({text.begin(), text.end()}, columns);
  if (expected.size() != table.size()) std::abort();
  for (std::size_t k = 0; k < table.size(); ++k)
    if (std::memcmp(&table[k], &expected[k], sizeof(double)) != 0 && table[k] == table[k])
      std::abort();
  return 0;
}
