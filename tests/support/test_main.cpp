// main of every GoogleTest program that has none of its own: GRIDCAST_ISA limits the instruction set.

#include <iostream>

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (const gridcast::Status limited = gridcast::limit_instruction_set_by_environment(); !limited) {
    std::cerr << limited.error().where << ": " << limited.error().message << '\n';
    return 2;
  }
  std::cout << "instruction set " << gridcast::instruction_set() << " (GRIDCAST_ISA limits it)\n";
  return RUN_ALL_TESTS();
}
