#include "proto/json_break.h"

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/json_pointer.h"

namespace gridcast::proto {
namespace {

/// Follows the parse with a stack of steps and stops at the first thing wrong.
class BreakFinder : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit BreakFinder(std::size_t max_depth) : max_depth_(max_depth) {}
  Problem problem{ProblemCode::kInvalidJson, "the body is not JSON", ""};

  bool null() override { return next(); }
  bool boolean(bool) override { return next(); }
  bool number_integer(number_integer_t) override { return next(); }
  bool number_unsigned(number_unsigned_t) override { return next(); }
  bool number_float(number_float_t, const string_t& text) override {
    if (text.find_first_of(".eE") != std::string::npos) return next();
    return stop(ProblemCode::kOutOfRange, "an integer does not fit in 64 bits");
  }
  bool string(string_t&) override { return next(); }
  bool binary(binary_t&) override { return next(); }
  bool start_object(std::size_t) override { return push(Step{"", 0, Container::kObject}); }
  bool start_array(std::size_t) override { return push(Step{"", 0, Container::kArray}); }
  bool end_object() override { return pop(); }
  bool end_array() override { return pop(); }
  bool key(string_t& name) override {
    steps_.back().key = name.substr(0, kMaxPointerKeyBytes);
    return true;
  }
  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::json::exception& error) override {
    constexpr int kNumberOverflow = 406;
    if (error.id == kNumberOverflow)
      return stop(ProblemCode::kOutOfRange, "a number does not fit in a double");
    return stop(ProblemCode::kInvalidJson,
                "the body breaks JSON's grammar at byte " + std::to_string(position));
  }

 private:
  enum class Container { kObject, kArray };
  struct Step {
    std::string key;
    std::size_t index;
    Container container;
  };

  bool stop(ProblemCode code, std::string detail) {
    std::string pointer;
    for (const Step& step : steps_) {
      if (step.container == Container::kArray)
        append_pointer(pointer, step.index);
      else if (!step.key.empty())
        append_pointer(pointer, step.key);
    }
    problem = {code, std::move(detail), std::move(pointer)};
    return false;
  }
  bool next() {
    if (!steps_.empty()) ++steps_.back().index;
    return true;
  }
  bool push(Step step) {
    if (steps_.size() >= max_depth_)
      return stop(ProblemCode::kTooDeep, "nested deeper than " + std::to_string(max_depth_) + " levels");
    steps_.push_back(std::move(step));
    return true;
  }
  bool pop() {
    steps_.pop_back();
    return next();
  }

  std::size_t max_depth_;
  std::vector<Step> steps_;
};

}  // namespace

Problem find_json_break(std::string_view text, std::size_t max_depth) {
  BreakFinder finder(max_depth);
  nlohmann::json::sax_parse(text.begin(), text.end(), &finder);
  return finder.problem;
}

}  // namespace gridcast::proto
