#include "Interrupt.h"

#include <csignal>
#include <iostream>

#include "Result.h"

namespace jacket::demo {

namespace {

volatile std::sig_atomic_t interrupted = 0;

}  // namespace

void catchInterrupts() {
    std::signal(SIGINT, [](int) { interrupted = 1; });
    std::signal(SIGTERM, [](int) { interrupted = 1; });
}

bool isInterrupted() {
    return interrupted != 0;
}

int endInterrupted(bool hasFolder) {
    std::cerr << "jacket: interrupted" << (hasFolder ? "; nothing was written" : "") << '\n';
    return kInterrupted;
}

}  // namespace jacket::demo
