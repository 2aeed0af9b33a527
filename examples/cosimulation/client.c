/* A client of 'steer-env serve' in C: one second of a sine of 3 N m at the handwheel, step by step.
 *
 *     steer-env serve --subsystem car --describe c > packets.h
 *     cc -std=gnu11 -O2 -o client client.c -lm
 *     steer-env serve --subsystem car --port 5005 &
 *     ./client 127.0.0.1 5005     # once the server has printed "ready"; it tries for five seconds
 *
 * It prints time, handwheel angle and torsion-bar torque after every millisecond. Both calls of 'serve' need the same
 * options of the car; with '--hands angle' the car follows the input hand_angle and not this torque. The sockets are
 * those of POSIX. */

#include "packets.h"

#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>

enum { STEPS = 1000, TRIES = 50, PATIENCE_US = 100000 };

static int64_t now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

/* Send a request until its answer arrives; 0 where there is none. A lost packet costs time and nothing else, because
 * the server carries out each sequence number once and gives the same answer again. */
static int exchange(int link, struct steer_request *request, struct steer_answer *answer)
{
    struct steer_header *asked = &request->header, *told = &answer->header;
    int reached = 1;
    asked->sent = now();
    asked->check = steer_checksum(request, sizeof *request);
    for (int i = 0; i < TRIES; i++) {
        if (send(link, request, sizeof *request, 0) < 0 && errno != ECONNREFUSED)
            perror("send");
        for (;;) {
            ssize_t size = recv(link, answer, sizeof *answer, 0);
            if (size < 0) {
                reached = errno != ECONNREFUSED;
                if (!reached) /* the server does not receive at its port, yet */
                    nanosleep(&(struct timespec){.tv_nsec = 1000L * PATIENCE_US}, NULL);
                break; /* nothing in time: ask again */
            }
            if (size < (ssize_t)sizeof *told || told->magic != STEER_MAGIC)
                continue;
            if (told->check != steer_checksum(answer, (size_t)size))
                continue;
            if (told->session != asked->session || told->sequence != asked->sequence)
                continue; /* an older answer */
            if (told->kind == STEER_REFUSED) {
                if (told->code == STEER_BAD_BUSY)
                    fprintf(stderr, "another client's session is open, for %u s more if that stays silent\n", told->detail);
                else
                    fprintf(stderr, "refused with reason %u, detail %u\n", told->code, told->detail);
                return 0;
            }
            asked->sequence++;
            return 1;
        }
    }
    fprintf(stderr, reached ? "no answer\n" : "nothing receives there: wait until the server prints 'ready'\n");
    return 0;
}

int main(int count, char **words)
{
    struct sockaddr_in server = {.sin_family = AF_INET};
    if (count != 3 || !inet_aton(words[1], &server.sin_addr)) {
        fprintf(stderr, "usage: client ADDRESS PORT\n");
        return 2;
    }
    server.sin_port = htons((uint16_t)atoi(words[2]));
    int link = socket(AF_INET, SOCK_DGRAM, 0);
    struct timeval patience = {.tv_usec = PATIENCE_US};
    setsockopt(link, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    connect(link, (struct sockaddr *)&server, sizeof server);

    struct steer_request request = {
        .header = {.magic = STEER_MAGIC, .version = STEER_VERSION, .layout = STEER_LAYOUT, .kind = STEER_OPEN}};
    struct steer_answer answer;
    request.header.session = (uint64_t)now(); /* a number that was not used before */
    if (!exchange(link, &request, &answer))
        return 1;
    request.header.kind = STEER_STEP;
    request.header.samples = 1;
    for (int i = 1; i <= STEPS; i++) {
        request.inputs[STEER_IN_HAND_TORQUE] = 3.0 * sin(2.0 * 3.141592653589793 * 1e-3 * i);
        if (!exchange(link, &request, &answer))
            return 1;
        printf("%.3f %.17g %.17g\n", answer.header.time, answer.outputs[STEER_OUT_HANDWHEEL_ANGLE],
               answer.outputs[STEER_OUT_TORSION_BAR_TORQUE]);
    }
    request.header.kind = STEER_CLOSE;
    return !exchange(link, &request, &answer);
}
