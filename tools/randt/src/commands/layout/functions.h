/* The live bus: link with -lrandt_bus. One thread at a time may use a bus and its readers. */
#ifdef __cplusplus
extern "C" {
#endif

struct randt_bus;
struct randt_reader;

/* A message where it lies in shared memory; cast head and items to the topic's structs. */
struct randt_message {
    const void *head;
    const void *items;
    size_t item_count;
};

/* Opens the bus of a pipeline; prefix and run are the programs' options, NULL for what they take
   without them. NULL where no stage lives, and for every other error. */
struct randt_bus *randt_bus_open(const char *prefix, const char *run);

/* Opens a topic, RANDT_..._TOPIC and RANDT_..._TYPE. NULL where no stage has opened it, or this
   header is not of the library's build. */
struct randt_reader *randt_bus_subscribe(struct randt_bus *bus, const char *topic, const char *type);

/* The next message: 1, and it lies there until the next call with this reader; 0, and head is
   NULL, if none has come in timeout_ms or a signal came; -1 for an error: close all, and open anew. */
int randt_reader_receive(struct randt_reader *reader, uint32_t timeout_ms, struct randt_message *message);

/* Messages that came too fast for this reader. */
uint64_t randt_reader_missed(const struct randt_reader *reader);

void randt_reader_close(struct randt_reader *reader);
void randt_bus_close(struct randt_bus *bus);

/* Why the last call of this thread failed. */
const char *randt_bus_error(void);

#ifdef __cplusplus
}
#endif
