#include "Commands.h"

int main(int argc, char** argv) {
    return jacket::demo::runProgram(argc, argv);
}
