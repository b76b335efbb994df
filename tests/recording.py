"""Reads a recording with the mcap package of PyPI, which shares nothing with mtj, and prints what is in it.

Usage: recording.py FILE.mcap; prints one JSON object. Every message is validated against the schema that the
file has for it. A file that was cut short is read as far as it goes.
"""

import json
import sys

from fastjsonschema import JsonSchemaException, compile
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader


def main(path):
    schemas, channels, topics, metadata = {}, {}, {}, {}
    finished = True
    with open(path, "rb") as file:
        records = StreamReader(file, validate_crcs=True).records
        try:
            for record in records:
                if isinstance(record, Schema):
                    assert record.encoding == "jsonschema", record.encoding
                    schemas[record.id] = (record.name, compile(json.loads(record.data)))
                elif isinstance(record, Channel):
                    assert record.message_encoding == "json", record.message_encoding
                    channels[record.id] = record
                    topics.setdefault(record.topic, new_topic(schemas[record.schema_id][0]))
                elif isinstance(record, Metadata):
                    metadata[record.name] = record.metadata
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    take(topics[channel.topic], record, schemas[channel.schema_id][1])
        except EndOfFile:
            finished = False
    result = {"finished": finished, "metadata": metadata, "topics": topics}
    if finished:
        with open(path, "rb") as file:
            summary = make_reader(file).get_summary()
            counts = summary.statistics.channel_message_counts
            result["summary"] = {channels[id].topic: count for id, count in counts.items()}
    json.dump(result, sys.stdout)


def new_topic(schema):
    return {"schema": schema, "messages": 0, "invalid": [], "gaps": 0, "first": None, "last": None, "runs": []}


def take(topic, record, validate):
    message = json.loads(record.data)
    topic["messages"] += 1
    try:
        validate(message)
    except JsonSchemaException as fault:
        topic["invalid"].append(str(fault))
    assert record.log_time == record.publish_time
    told = {"log_time": record.log_time, "sequence": record.sequence, **message}
    header = message.get("header")
    if header is not None:
        assert record.sequence == header["sequence"] % 2**32
        if header["run"] not in topic["runs"]:
            topic["runs"].append(header["run"])
        last = topic["last"]
        # The first state is repeated until a controller answers it.
        if last is not None and last["header"]["run"] == header["run"]:
            step = header["sequence"] - last["header"]["sequence"]
            topic["gaps"] += step > 1
            topic["repeated"] = topic.get("repeated", 0) + (step == 0)
            # As many ns apart as the instants are, however late they were heard.
            elapsed = record.log_time - last["log_time"]
            apart = header["time_ns"] - last["header"]["time_ns"]
            topic["elsewhen"] = topic.get("elsewhen", 0) + (step > 0 and last["sequence"] > 0 and elapsed != apart)
    topic["first"] = topic["first"] or told
    topic["last"] = told


main(sys.argv[1])
